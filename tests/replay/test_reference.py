"""What is said of a reference beside the tilt, in a replay and in tuning alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmg_mj.replay.logs import ReadOptions, read_log
from cmg_mj.replay.reference import AGREES, alignment_of, remarks_on
from tests.command import ROOT, cmg_mj
from tests.replay.logs.motion import COLUMNS, DT, N, sine, write_csv

REAL = ROOT / "examples" / "data" / "stepper_encoder_gyro.csv"
ENCODER = {"time": "time_s", "tilt": "encoder_rad", "rate": "gyr_y_rad_s"}


def remarks(path: Path, columns: dict[str, str] = COLUMNS, **given) -> list[str]:
    log = read_log(path, ReadOptions(columns, **given))
    return remarks_on(log, alignment_of(log))


def written(folder: Path, **changed: np.ndarray) -> Path:
    return write_csv(folder / "log.csv", {**sine(), **changed})


def test_a_tilt_that_freezes_is_offered_no_cure(tmp_path: Path) -> None:
    frozen = sine()["tilt_rad"].copy()
    frozen[N // 2 :] = frozen[N // 2]
    (said,) = remarks(written(tmp_path, tilt_rad=frozen))
    assert said.startswith("Tilt and reference hardly agree (correlation 0.71 at the best lag")
    assert "--" not in said


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
def test_a_cure_is_offered_from_the_criterion_on(noise: float, tmp_path: Path) -> None:
    """Half of the rate is missing; of a tilt as noisy as its motion nothing is offered."""
    log = sine()
    noisy = log["tilt_rad"] + noise * np.random.default_rng(0).standard_normal(N)
    path = written(tmp_path, tilt_rad=noisy, gyro_rad_s=0.5 * log["gyro_rad_s"])
    found = alignment_of(read_log(path, ReadOptions(COLUMNS)))
    assert found is not None
    assert found.correlation is not None
    (said,) = remarks(path)
    assert ("--scale rate=" in said) == (found.correlation >= AGREES) == (noise < 0.05)


def test_the_other_way_round(tmp_path: Path) -> None:
    (said,) = remarks(written(tmp_path, gyro_rad_s=-sine()["gyro_rad_s"]))
    assert said.endswith("it counts the other way: --scale rate=-1.")
    said = remarks(REAL, ENCODER, scale={"rate": -1.0})[-1]
    assert said.endswith("it counts the other way: --scale rate=1.")
    frozen = sine()["tilt_rad"].copy()
    frozen[N // 2 :] = frozen[N // 2]
    (said,) = remarks(written(tmp_path, tilt_rad=-frozen))
    assert said.startswith("Tilt and reference hardly agree (correlation -0.71")


def test_late_is_late_by_the_logs_own_rows() -> None:
    """Of 100 Hz rows 0.2 ms are nothing, to however quick a rate they are resampled."""
    for rate in (None, 1000.0):
        said = remarks(REAL, ENCODER, delay_s=0.0119, rate_hz=rate)
        assert [line for line in said if "Beside the tilt" in line] == []
    late = remarks(REAL, ENCODER, delay_s=0.010, rate_hz=1000.0)
    assert "(beyond what was set; to take it out: --delay 0.002" in late[-1]


@pytest.mark.parametrize(
    ("size", "units", "asks"),
    [
        (180.0 / np.pi, {}, ": is it deg/s?"),
        (np.pi / 180.0, {}, ": is it rad/s, or the tilt deg?"),
        (1.0, {"tilt": "deg"}, ": is it deg/s, or the tilt rad?"),
        (20.0, {}, ")."),
    ],
)
def test_degrees_taken_as_radians(size: float, units: dict[str, str], asks: str, tmp_path: Path) -> None:
    (said,) = remarks(written(tmp_path, gyro_rad_s=size * sine()["gyro_rad_s"]), units=units)
    assert said.endswith(asks)
    assert "to take it out: --scale rate=" in said


@pytest.mark.slow
def test_tuning_says_the_same(elsewhere: None) -> None:
    path = written(Path(), gyro_rad_s=np.interp(DT * np.arange(N) - 0.02, DT * np.arange(N), sine()["gyro_rad_s"]))
    columns = ("--columns", ",".join(f"{role}={name}" for role, name in COLUMNS.items()))
    (said,) = remarks(path)
    assert "--delay 0.02" in said
    replayed = cmg_mj("replay", path, *columns, "--observers", "linear").out
    tuned = cmg_mj("tune-log", path, *columns, "--observer", "linear", "--range", "tau=0.01:0.1").out
    assert " ".join(said.split()) in " ".join(replayed.split())
    assert " ".join(said.split()) in " ".join(tuned.split())


@pytest.mark.slow
def test_of_short_stretches_there_is_no_interval(elsewhere: None) -> None:
    import json

    columns = ("--columns", ",".join(f"{role}={name}" for role, name in COLUMNS.items()))
    tune = ("--observer", "linear", "--range", "tau=0.01:0.1", *columns)
    for rows, there in ((2500, True), (2350, False)):  # the second half less a second, by ten: 0.525 and 0.4875 s
        write_csv("log.csv", {name: values[:rows] for name, values in sine().items()})
        table = cmg_mj("tune-log", "log.csv", *tune).out
        assert ("No interval: the scored stretches are 0.48 s short; there is one from 0.5 s on." in table) != there
        found = json.loads(cmg_mj("tune-log", "log.csv", *tune, "--json").out)
        assert (found["verdict"] is not None) == (found["held_out_ratio"] is not None) == there
