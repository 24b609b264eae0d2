"""Accelerations of a wrong unit or sign are noticed, and nothing right is taken for that."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmg_mj import ReadOptions, load_scenario, prepare, read_log
from cmg_mj.replay.logs.columns import ACCELEROMETERS
from tests.replay.logs.motion import AMPLITUDE, DT, OMEGA, sine, write_csv
from tests.replay.logs.test_interchanged import INNER_FIRST, readings
from tests.tiers import slow_but

SECOND = {"time": "t_s", "tilt": "tilt_rad", "acceleration": "a"}


def notes_on(
    path: Path,
    unit_of: dict[str, str],
    radii: tuple[float, float] = (0.1, 0.3),
    scale: dict[str, float] | None = None,
) -> list[str]:
    units = {role: unit_of.get(role, unit_of.get("all", "m_s2")) for role in ACCELEROMETERS}
    return list(
        read_log(path, ReadOptions({"time": "t_s"} | INNER_FIRST, units=units, radii_m=radii, scale=scale or {})).notes
    )


@pytest.mark.parametrize("swing", [1e-5, 0.02, 0.2, 0.5])
def test_accelerometers_in_a_wrong_unit(swing: float, tmp_path: Path) -> None:
    """The cure that is named is one; of violent swings and of noise alone nothing is said if the unit is right."""
    path = write_csv(tmp_path / "log.csv", readings(3, swing))
    assert notes_on(path, {}) == []
    (wrong,) = notes_on(path, {"all": "g"})
    assert wrong.endswith(": --units inner_x=m_s2,inner_z=m_s2,outer_x=m_s2,outer_z=m_s2")
    assert " 9.8" in wrong or swing == 0.5
    (wrong,) = notes_on(path, {"outer_x": "mm_s2", "outer_z": "mm_s2"})
    assert wrong.endswith(": --units outer_x=m_s2,outer_z=m_s2")
    assert "the outer accelerometer's specific force is 0.001" in wrong


def test_large_specific_forces_that_are_motion(tmp_path: Path) -> None:
    """30 degrees at 2.5 Hz, 0.6 m from the pivot: most of what the outer one shows is motion."""
    t, w = DT * np.arange(2000), 2.0 * np.pi * 2.5
    y, rate, a = 0.52 * np.sin(w * t), 0.52 * w * np.cos(w * t), -0.52 * w**2 * np.sin(w * t)
    columns = {"t_s": t}
    for name, r in (("a", 0.3), ("b", 0.6)):
        columns |= {f"{name}_x": r * a - 9.81 * np.sin(y), f"{name}_z": 9.81 * np.cos(y) - r * rate**2}
    assert np.median(np.hypot(columns["b_x"], columns["b_z"])) > 3.0 * 9.81
    assert notes_on(write_csv(tmp_path / "log.csv", columns), {}, (0.3, 0.6)) == []


def test_a_scale_where_no_unit_fits(tmp_path: Path) -> None:
    """Counts of 16384 a g, taken as m/s^2, of sensors that are mounted the other way round."""
    raw = {name: values * (1.0 if name == "t_s" else -16384.0 / 9.80665) for name, values in readings(1, 0.1).items()}
    path = write_csv(tmp_path / "log.csv", raw)
    inversion: dict[str, float] = dict.fromkeys(ACCELEROMETERS, -1.0)
    (wrong,) = notes_on(path, {}, scale=inversion)
    scales = {role: float(text) for role, _, text in (p.partition("=") for p in wrong.split("--scale ")[1].split(","))}
    assert scales == pytest.approx(dict.fromkeys(ACCELEROMETERS, -9.80665 / 16384.0), rel=0.01)
    assert notes_on(path, {}, scale=scales) == []


@pytest.mark.parametrize("factor", [0.2, 3.0])
def test_radii_that_are_wrong(factor: float, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", readings(2, 0.2, noise=0.01))
    (wrong,) = notes_on(path, {}, (0.1 * factor, 0.3 * factor))
    assert "are --units and --radii (in m) right?" in wrong
    assert notes_on(write_csv(tmp_path / "noise.csv", readings(2, 1e-5)), {}, (0.1 * factor, 0.3 * factor)) == []


@pytest.mark.parametrize(
    ("size", "scale", "message"),
    [
        (1.0, 1.0, None),
        (1.3, 1.0, None),
        (
            -1.0,
            1.0,
            "counts the other way beside the tilt's second derivative (correlation -1.00): --scale acceleration=-1",
        ),
        (1.0, -1.0, "--scale acceleration=1"),
        (
            180.0 / np.pi,
            1.0,
            "is 57.3 times as large beside the tilt's second derivative (correlation 1.00): "
            "--units acceleration=deg_s2, if the tilt's unit is right",
        ),
        (-180.0 / np.pi, 1.0, "--units acceleration=deg_s2 --scale acceleration=-1, if the tilt's unit is right"),
        (0.1, 2.0, "--scale acceleration=10"),
    ],
)
def test_a_given_acceleration(size: float, scale: float, message: str | None, tmp_path: Path) -> None:
    log = sine()
    noise = np.random.default_rng(0).standard_normal((2, len(log["t_s"])))
    columns = {"t_s": log["t_s"], "tilt_rad": log["tilt_rad"] + 1e-3 * noise[0]}
    columns["a"] = size * (-AMPLITUDE * OMEGA**2 * np.sin(OMEGA * log["t_s"]) + 0.5 * noise[1])
    path = write_csv(tmp_path / "log.csv", columns)
    notes = read_log(path, ReadOptions(SECOND, units={"acceleration": "rad_s2"}, scale={"acceleration": scale})).notes
    if message is None:
        assert notes == ()
    else:
        (note,) = notes
        assert note.endswith(message)


@pytest.mark.parametrize("first", slow_but(range(0, 21, 7), 0))
def test_noise_alone_says_nothing(tmp_path: Path, first: int) -> None:
    for seed in range(first, first + 7):
        noise = np.random.default_rng(seed).standard_normal((2, 2000))
        log = {"t_s": DT * np.arange(2000), "tilt_rad": 1e-3 * noise[0], "a": noise[1]}
        log["a"] += (0.0, 0.95, -0.95)[seed % 3] * 20.0 * noise[0]
        path = write_csv(tmp_path / "log.csv", log)
        assert read_log(path, ReadOptions(SECOND, units={"acceleration": "rad_s2"})).notes == ()


@pytest.mark.daily_cases("push_recovery", "single_gimbal", "bias_estimation", "luenberger_fails")
@pytest.mark.parametrize(
    "scenario", ["push_recovery", "bias_estimation", "single_gimbal", "observer_tuning", "luenberger_fails"]
)
def test_the_runs_of_all_scenarios(scenario: str, tmp_path: Path) -> None:
    trajectory = prepare(load_scenario(scenario)).run().trajectory
    assert trajectory is not None
    trajectory.save(tmp_path / "run.parquet")
    columns = {"time": "time_s", "tilt": "y1_rad", "acceleration": "acceleration_rad_s2"}
    assert read_log(tmp_path / "run.parquet", ReadOptions(columns)).notes == ()


def test_a_run_whose_acceleration_is_turned_round(tmp_path: Path) -> None:
    trajectory = prepare(load_scenario("push_recovery", ["sensors.accelerometer.noise_density_ug_rthz=50"])).run()
    assert trajectory.trajectory is not None
    trajectory.trajectory.save(tmp_path / "run.parquet")
    columns = {"time": "time_s", "tilt": "y1_rad", "acceleration": "acceleration_rad_s2"}
    (note,) = read_log(tmp_path / "run.parquet", ReadOptions(columns, scale={"acceleration": -1.0})).notes
    assert note.endswith("--scale acceleration=1")
