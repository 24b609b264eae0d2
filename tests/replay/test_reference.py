"""Remarks on a reference beside the tilt, in a replay and in tuning alike."""

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


def remarks(path: Path, columns: dict[str, str] = COLUMNS, **options) -> list[str]:
    log = read_log(path, ReadOptions(columns, **options))
    return remarks_on(log, alignment_of(log))


def write_sine(folder: Path, **columns: np.ndarray) -> Path:
    return write_csv(folder / "log.csv", {**sine(), **columns})


def test_a_tilt_that_freezes_is_offered_no_cure(tmp_path: Path) -> None:
    tilt = sine()["tilt_rad"].copy()
    tilt[N // 2 :] = tilt[N // 2]
    (remark,) = remarks(write_sine(tmp_path, tilt_rad=tilt))
    assert remark.startswith("Tilt and reference hardly agree (correlation 0.71 at the best lag")
    assert "--" not in remark


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
def test_a_cure_is_offered_from_the_criterion_on(noise: float, tmp_path: Path) -> None:
    """Half of the rate is missing; of a tilt as noisy as its motion nothing is offered."""
    log = sine()
    noisy = log["tilt_rad"] + noise * np.random.default_rng(0).standard_normal(N)
    path = write_sine(tmp_path, tilt_rad=noisy, gyro_rad_s=0.5 * log["gyro_rad_s"])
    fit = alignment_of(read_log(path, ReadOptions(COLUMNS)))
    assert fit is not None
    assert fit.correlation is not None
    (remark,) = remarks(path)
    assert ("--scale rate=" in remark) == (fit.correlation >= AGREES) == (noise < 0.05)


def test_the_other_way_round(tmp_path: Path) -> None:
    (remark,) = remarks(write_sine(tmp_path, gyro_rad_s=-sine()["gyro_rad_s"]))
    assert remark.endswith("it counts the other way: --scale rate=-1.")
    remark = remarks(REAL, ENCODER, scale={"rate": -1.0})[-1]
    assert remark.endswith("it counts the other way: --scale rate=1.")
    tilt = sine()["tilt_rad"].copy()
    tilt[N // 2 :] = tilt[N // 2]
    (remark,) = remarks(write_sine(tmp_path, tilt_rad=-tilt))
    assert remark.startswith("Tilt and reference hardly agree (correlation -0.71")


def test_late_is_late_by_the_logs_own_rows() -> None:
    """A delay of 0.2 ms is nothing for rows at 100 Hz, to however quick a rate they are resampled."""
    for rate in (None, 1000.0):
        notes = remarks(REAL, ENCODER, delay_s=0.0119, rate_hz=rate)
        assert [line for line in notes if "Beside the tilt" in line] == []
    late = remarks(REAL, ENCODER, delay_s=0.010, rate_hz=1000.0)
    assert "(beyond what was set; to take it out: --delay 0.002" in late[-1]


@pytest.mark.parametrize(
    ("size", "units", "question"),
    [
        (180.0 / np.pi, {}, ": is it deg/s?"),
        (np.pi / 180.0, {}, ": is it rad/s, or the tilt deg?"),
        (1.0, {"tilt": "deg"}, ": is it deg/s, or the tilt rad?"),
        (20.0, {}, ")."),
    ],
)
def test_degrees_taken_as_radians(size: float, units: dict[str, str], question: str, tmp_path: Path) -> None:
    (remark,) = remarks(write_sine(tmp_path, gyro_rad_s=size * sine()["gyro_rad_s"]), units=units)
    assert remark.endswith(question)
    assert "to take it out: --scale rate=" in remark


@pytest.mark.slow
def test_tuning_says_the_same(elsewhere: None) -> None:
    path = write_sine(Path(), gyro_rad_s=np.interp(DT * np.arange(N) - 0.02, DT * np.arange(N), sine()["gyro_rad_s"]))
    columns = ("--columns", ",".join(f"{role}={name}" for role, name in COLUMNS.items()))
    (remark,) = remarks(path)
    assert "--delay 0.02" in remark
    replay_output = cmg_mj("replay", path, *columns, "--observers", "linear").out
    tuning_output = cmg_mj("tune-log", path, *columns, "--observer", "linear", "--range", "tau=0.01:0.1").out
    assert " ".join(remark.split()) in " ".join(replay_output.split())
    assert " ".join(remark.split()) in " ".join(tuning_output.split())


@pytest.mark.slow
def test_of_short_stretches_there_is_no_interval(elsewhere: None) -> None:
    import json

    columns = ("--columns", ",".join(f"{role}={name}" for role, name in COLUMNS.items()))
    tune = ("--observer", "linear", "--range", "tau=0.01:0.1", *columns)
    for rows, has_interval in (
        (2500, True),
        (2350, False),
    ):  # the second half less a second, by ten: 0.525 and 0.4875 s
        write_csv("log.csv", {name: values[:rows] for name, values in sine().items()})
        table = cmg_mj("tune-log", "log.csv", *tune).out
        assert (
            "No interval: the scored stretches are 0.48 s short; there is one from 0.5 s on." in table
        ) != has_interval
        result = json.loads(cmg_mj("tune-log", "log.csv", *tune, "--json").out)
        assert (result["verdict"] is not None) == (result["held_out_ratio"] is not None) == has_interval
