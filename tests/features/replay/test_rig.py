"""Accelerometers at odd places, as a rig file names them, show the motion; a wrong file is named in one line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.replay.log import Log, LogNoise, ReadOptions
from cmg_mj.features.replay.log_replay import model_of, replay_prepared
from cmg_mj.features.replay.noise import noise_of
from cmg_mj.features.replay.reading import read_log
from cmg_mj.scenario.rig_file import Rig, load_rig
from tests.features.replay.motion import DT, OMEGA, N, rate, sine, tilt, write_csv

T = DT * np.arange(N)
ALPHA = -(OMEGA**2) * tilt(T)
PLACED = [(0.03, 0.16, 42.0, (0.97, -1.02), (0.3, -0.4)), (-0.02, 0.15, -130.0, (1.01, 1.0), (0.0, 0.2))]
NOISE = 0.05


def logged(
    folder: Path, n_accelerometers: int, columns: Mapping[str, str] = {}, noise: float = 0.0, fields: str = ""
) -> Log:
    """The sine as accelerometers show it that stand as `PLACED` says."""
    random, shown, text = np.random.default_rng(5), sine(T), fields
    for i, (across, up, angle, scale, offset) in enumerate(PLACED[:n_accelerometers]):
        y, w, cosine, sinus = tilt(T), rate(T), np.cos(np.radians(angle)), np.sin(np.radians(angle))
        x = ALPHA * up - w * w * across - STANDARD_GRAVITY * np.sin(y)
        z = -ALPHA * across - w * w * up + STANDARD_GRAVITY * np.cos(y)
        for name, axis, s, o in zip("xz", (cosine * x + sinus * z, cosine * z - sinus * x), scale, offset, strict=True):
            shown[f"{name}{i}_mg"] = (s * (axis + noise * random.standard_normal(N)) + o) / (1e-3 * STANDARD_GRAVITY)
        text += f'[[accelerometer]]\ncolumns = ["x{i}_mg", "z{i}_mg"]\nunit = "mg"\nplace_m = [{across}, {up}]\n'
        text += f"angle_deg = {angle}\nscale = {list(scale)}\noffset_m_s2 = {list(offset)}\nnoise_m_s2 = {NOISE}\n"
    (folder / "rig.toml").write_text(text)
    rig, path = load_rig(folder / "rig.toml"), write_csv(folder / "log.csv", shown)
    return read_log(path, ReadOptions({"time": "t_s", "rate": "gyro_rad_s", **columns}, rig=rig))


@pytest.mark.parametrize(("n", "columns"), [(2, {}), (2, {"tilt": "tilt_rad"}), (1, {"tilt": "tilt_rad"})])
def test_they_show_tilt_and_angular_acceleration(n: int, columns: dict[str, str], tmp_path: Path) -> None:
    log = logged(tmp_path, n, columns)
    np.testing.assert_allclose(log["y1_rad"], tilt(T), atol=1e-9)
    np.testing.assert_allclose(log["acceleration_rad_s2"], ALPHA, atol=1e-7)


def test_an_axis_may_be_named_as_a_role_is(tmp_path: Path) -> None:
    shown = {**sine(T), "ay": 0.0 * T, "ax": 0.0 * T + STANDARD_GRAVITY}
    rig = Rig.model_validate({"accelerometer": [{"columns": ("ay", "ax"), "place_m": (0.0, -0.15)}]})
    columns = {"time": "t_s", "tilt": "tilt_rad", "rate": "gyro_rad_s"}
    notes = read_log(write_csv(tmp_path / "log.csv", shown), ReadOptions(columns, rig=rig)).notes
    assert not any("ax" in note for note in notes)


@pytest.mark.parametrize("n_rows", [N, 800])
def test_observers_assume_the_logs_noise_or_of_a_short_one_the_files(n_rows: int, tmp_path: Path) -> None:
    log = logged(tmp_path, 2, noise=NOISE)
    assumed = noise_of(log if n_rows == N else replace(log, white_noise=LogNoise("it is short", "it is short", 0.0)))
    assert assumed.tilt == pytest.approx(np.std(log["y1_rad"] - tilt(T)), rel=0.05)
    assert assumed.acceleration == pytest.approx(np.std(log["acceleration_rad_s2"] - ALPHA), rel=0.05)
    assert noise_of(log, {"accelerometer": 400.0}).tilt < 0.8 * assumed.tilt


@pytest.mark.parametrize(
    ("fields", "n", "message"),
    [
        ("", 1, "accelerometer: they do not show the angular acceleration, being at one place: give a second one"),
        ("pivots = 1\n", 2, "rig.toml: pivots: no such field; did you mean 'pivot_moves'?"),
        ("[pendulum]\ninertia = 0.0\ngravity_torque = 1.0\n", 2, "pendulum.inertia = 0"),
        ("nothing", 2, "not valid TOML"),
    ],
)
def test_what_a_rig_file_gets_wrong(fields: str, n: int, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        logged(tmp_path, n, fields=fields)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_rig_without_accelerometers_changes_nothing() -> None:
    assert "rig" not in ReadOptions({"tilt": "a"}, rig=Rig()).as_toml()


def pushed_pendulum() -> dict[str, np.ndarray]:
    """An inverted pendulum of 0.06 kg m^2 and 3.4 N m that a motor holds while it swings, by small steps of Euler's."""
    y, w, columns, steps = 0.05, 0.0, np.zeros((4, N)), 20
    for k in range(N):
        torque = -8.0 * y - 0.3 * w + 0.5 * np.sin(3.0 * T[k])
        columns[:, k] = T[k], y, w, torque
        for _ in range(steps):
            w += DT / steps * (3.4 * np.sin(y) + torque) / 0.06
            y += DT / steps * w
    columns[1] += 1e-3 * np.random.default_rng(6).standard_normal(N)
    return dict(zip(("t_s", "tilt_rad", "gyro_rad_s", "motor_n_m"), columns, strict=True))


def test_a_known_torque_moves_the_models_of_observers(tmp_path: Path) -> None:
    """The wrong sign of it is worse for all of them, and worse than an estimate of zero for none that has the right."""
    path = write_csv(tmp_path / "log.csv", pushed_pendulum())
    roles = {"time": "t_s", "tilt": "tilt_rad", "rate": "gyro_rad_s", "torque": "motor_n_m"}
    errors = []
    for sign in (1.0, -1.0):
        log = read_log(path, ReadOptions(roles, scale={"torque": sign}))
        replayed = replay_prepared(
            log, ["ltv", "homogeneous", "kalman", "adaptive"], model=model_of("inertia=0.06,gravity_torque=3.4")
        )
        errors.append({name: row["velocity_rms_error_rad_s"] for name, row in replayed.summaries.items()})
    right, wrong = errors
    for name in ("ltv", "homogeneous", "kalman", "adaptive"):
        assert right[name] < 0.3 * right["zero"], name
        assert right[name] < 0.7 * wrong[name], name
