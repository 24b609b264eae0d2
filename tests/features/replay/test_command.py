"""`cmg-mj replay` as a user types it."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from cmg_mj.results.trajectory import Trajectory
from tests.command import ROOT, CommandOutcome, cmg_mj
from tests.features.replay.motion import COLUMNS, sine, write_csv

LOG = ROOT / "examples" / "data" / "stepper_encoder_gyro.csv"
REAL = "time=time_s,tilt=encoder_rad,rate=gyr_y_rad_s"
PLAIN = ",".join(f"{role}={name}" for role, name in COLUMNS.items())


@pytest.fixture(autouse=True)
def _logs(elsewhere: None) -> None:
    write_csv("sine.csv", sine())


def replay(*arguments: object) -> CommandOutcome:
    return cmg_mj("replay", *arguments)


def files(folder: Path | str) -> list[str]:
    return sorted(name for name in os.listdir(folder) if name != ".cmg_mj")


@pytest.mark.slow
def test_the_real_log() -> None:
    """Its gyro comes 12 ms behind and is 1.5 % too small, says its .txt; a difference is half a sample late,
    of which the 0.1 ms that --delay leaves go."""
    raw_log = json.loads(replay(LOG, "--columns", REAL, "--observers", "linear", "--json").out)["logs"][0]
    assert raw_log["reference"]["lag_s"] == pytest.approx(0.012, abs=2e-4)
    assert raw_log["reference"]["scale"] == pytest.approx(1.015, abs=2e-3)
    outcome = replay(LOG, "--columns", REAL, "--delay", 0.012, "--scale", "rate=1.015", "--json")
    (log,) = json.loads(outcome.out)["logs"]
    assert log["observers"]["finite_difference"]["lag_s"] == pytest.approx(0.0050 - 0.0001, abs=5e-5)
    assert 0.75 < log["observers"]["finite_difference"]["velocity_fit"] < 0.8
    assert 0.02 < log["observers"]["linear"]["lag_s"] < 0.03
    assert log["observers"]["zero"]["velocity_fit"] == 0.0
    assert abs(log["reference"]["lag_s"]) < 2e-4
    assert set(log["left_out"]) >= {"ltv", "homogeneous", "gyro_free"}


@pytest.mark.slow
def test_what_it_writes() -> None:
    outcome = replay("sine.csv", "--columns", PLAIN, "--window", "2:4", "--out", "it")
    assert outcome.status == 0
    assert "Open the recording: rerun it/recording.rrd" in outcome.err
    assert files("it") == ["plot.png", "recording.rrd", "replay.toml", "signals.parquet", "summary.json"]
    assert (Path("it") / "plot.png").read_bytes()[:4] == b"\x89PNG"
    observers = json.loads((Path("it") / "summary.json").read_text())["logs"][0]["observers"]
    linear = observers["linear"]
    assert linear["velocity_rms_error_push_rad_s"] == pytest.approx(linear["velocity_rms_error_rad_s"], rel=1e-2)
    signals = Trajectory.load(Path("it") / "signals.parquet")
    assert signals.observers == tuple(name for name in observers if name != "zero")
    np.testing.assert_array_equal(signals["reference_rad_s"], sine()["gyro_rad_s"])
    assert "estimate/linear/x2_rad_s" in signals.columns
    entities = {str(chunk.entity_path) for chunk in RrdReader("it/recording.rrd").stream()}
    assert {
        "/sine/tilt/measured",
        "/sine/rate/true",
        "/sine/rate_estimate/1_linear",
        "/summary",
        "/settings",
    } <= entities


@pytest.mark.slow
def test_several_logs() -> None:
    os.mkdir("other")
    write_csv("other/sine.csv", {name: values[:2000] for name, values in sine().items()})
    arguments = ("sine.csv", "other/sine.csv", "--columns", PLAIN, "--observers", "linear,finite_difference")
    result = json.loads(replay(*arguments, "--out", "it", "--json").out)
    assert [log["samples"] for log in result["logs"]] == [4000, 2000]
    single = {"recording.rrd", "replay.toml", "summary.json"}
    assert set(files("it")) - single == {
        f"{name}.{ending}"
        for log in ("sine", "sine-2")
        for name, ending in ((f"plot-{log}", "png"), (f"signals-{log}", "parquet"))
    }
    table, markdown = replay(*arguments).out, replay(*arguments, "--markdown").out
    assert "| `finite_difference` |" in markdown
    for text in (table, markdown):
        assert "2.50" in text  # the lag [ms]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "--columns"),
        (("--columns", PLAIN, "--rate", "0"), "--rate"),
        (("--columns", PLAIN, "--max-gap", "-1"), "--max-gap"),
        (("--columns", PLAIN, "--scale", "rate=x"), "--scale rate=x: "),
        (("--columns", PLAIN, "--radii", "1"), "--radii '1'"),
        (("--columns", PLAIN, "--time-range", "5:1"), "--time-range 5:1"),
        (("--columns", PLAIN, "--window", "a"), "--window 'a'"),
        (("--columns", PLAIN, "--observers", "liner"), "did you mean 'linear'?"),
        (("--columns", PLAIN, "--observers", "linear", "--set", "ltv.Q=1"), "--set ltv: "),
        (("--columns", PLAIN, "--set", "linear.tau=-1"), "tau = -1: "),
        (("--columns", PLAIN, "--settle-s", "nan"), "--settle-s nan"),
        (("--columns", PLAIN, "--noise", "tilt=0.05,tilt=0.1"), "--noise tilt: "),
        (("--columns", PLAIN, "--model", "x.xml"), "no such file, nor a bundled one"),
        (("./sine.csv", "--columns", PLAIN), "sine.csv: this log is given twice"),
    ],
)
def test_wrong_arguments(arguments: tuple, message: str) -> None:
    assert message in replay("sine.csv", *arguments).complaint
    assert not Path("runs").exists()
