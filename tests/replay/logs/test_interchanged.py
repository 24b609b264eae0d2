"""Two accelerometers named the wrong way round are noticed, and nothing else is taken for that."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmg_mj import ReadOptions, load_scenario, prepare, read_log
from cmg_mj.core.tilt import RadialTilt
from cmg_mj.replay.logs.acceleration_checks import SWAPPED, TiltMotion, interchanged
from cmg_mj.replay.logs.columns import ACCELEROMETERS
from tests.replay.logs.motion import DT, write_csv
from tests.tiers import slow_but

PLACES = RadialTilt(0.1, 0.3)
INNER_FIRST: dict[str, str] = dict(zip(ACCELEROMETERS, ("a_x", "a_z", "b_x", "b_z"), strict=True))
OUTER_FIRST: dict[str, str] = dict(zip(ACCELEROMETERS, ("b_x", "b_z", "a_x", "a_z"), strict=True))


def readings(seed: int, swing: float, noise: float = 0.04, n: int = 2000) -> dict[str, np.ndarray]:
    """Make readings of a pendulum that swings at 0.7 and 1.9 Hz: r y'' - g sin y, g cos y - r y'^2 [m/s^2]."""
    rng, t = np.random.default_rng(seed), DT * np.arange(n)
    y, rate, acceleration = np.zeros(n), np.zeros(n), np.zeros(n)
    for size, hertz in ((swing, 0.7), (0.3 * swing, 1.9)):
        w, phase = 2.0 * np.pi * hertz, rng.uniform(0.0, 2.0 * np.pi)
        y += size * np.sin(w * t + phase)
        rate += size * w * np.cos(w * t + phase)
        acceleration -= size * w**2 * np.sin(w * t + phase)
    columns = {"t_s": t}
    for name, r in (("a", PLACES.r_inner), ("b", PLACES.r_outer)):
        columns[f"{name}_x"] = r * acceleration - 9.81 * np.sin(y) + noise * rng.standard_normal(n)
        columns[f"{name}_z"] = 9.81 * np.cos(y) - r * rate**2 + noise * rng.standard_normal(n)
    return columns


def notes(path: Path, columns: dict[str, str]) -> list[str]:
    units: dict[str, str] = dict.fromkeys(ACCELEROMETERS, "m_s2")
    log = read_log(path, ReadOptions({"time": "t_s", **columns}, units=units, radii_m=(PLACES.r_inner, PLACES.r_outer)))
    return list(log.notes)


@pytest.mark.daily_cases("0.02", "0.2")
@pytest.mark.parametrize("swing", [0.02, 0.1, 0.2])
def test_a_known_motion(swing: float, tmp_path: Path) -> None:
    for seed in range(5):
        path = write_csv(tmp_path / "log.csv", readings(seed, swing))
        assert notes(path, INNER_FIRST) == []
        assert notes(path, OUTER_FIRST) == [SWAPPED]


@pytest.mark.parametrize("first", slow_but(range(0, 20, 4), 0))
def test_noise_alone_says_nothing(tmp_path: Path, first: int) -> None:
    for seed in range(first, first + 4):
        path = write_csv(tmp_path / "log.csv", readings(seed, 1e-5))
        assert notes(path, INNER_FIRST) == notes(path, OUTER_FIRST) == []


@pytest.mark.daily_cases("bias_estimation-True", "single_gimbal-True", "luenberger_fails-False")
@pytest.mark.parametrize(
    ("scenario", "suspicion"),
    [
        ("push_recovery", True),
        ("bias_estimation", True),
        ("single_gimbal", True),
        ("observer_tuning", True),
        ("luenberger_fails", False),  # over after two seconds: too short to tell
    ],
)
def test_the_runs_of_all_scenarios(scenario: str, suspicion: bool) -> None:
    """As recorded, and as they were with the columns interchanged: y + c a, -a."""
    experiment = prepare(load_scenario(scenario, ["duration_s=5"] if scenario != "bias_estimation" else []))
    trajectory, places = experiment.run().trajectory, experiment.plant.parameters.tilt
    assert trajectory is not None
    y, a = trajectory["y1_rad"], trajectory["acceleration_rad_s2"]
    everything = [slice(0, len(y))]
    dt = float(trajectory["time_s"][1] - trajectory["time_s"][0])
    assert not interchanged(TiltMotion(y, a, everything, dt), places)
    interchange = y - (places.r_inner + places.r_outer) * a / 9.80665
    assert interchanged(TiltMotion(interchange, -a, everything, dt), places) == suspicion
