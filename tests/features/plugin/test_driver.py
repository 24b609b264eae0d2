"""A run with a plugin as its driver: the files of a run by the native one."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from cmg_mj import load_scenario, prepare
from cmg_mj.cli import main
from tests.features.plugin.made import assert_same_run, needs_compiler

pytestmark = [needs_compiler, pytest.mark.slow]


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("push_recovery", ('open_loop_observers=["kalman", "homogeneous"]',)),
        ("two_axes", ("sensors.accelerometer.bandwidth_hz=94",)),
    ],
)
def test_every_column_is_the_native_ones(scenario: str, settings: tuple[str, ...]) -> None:
    experiment = prepare(load_scenario(scenario, settings, "gyro_free"))
    native, plugin = experiment.run(world=3), experiment.run("plugin", world=3)
    assert_same_run(native, plugin)
    assert plugin.summaries == native.summaries
    assert (native.driver, plugin.driver) == ("native", "plugin")


def test_command_that_makes_a_plugin(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And its examples, in Python and in C, show the rig that nobody pushes as a run does."""
    folder = tmp_path / "balance"
    main(["plugin", "gyro_free", "--out", str(folder), "--json"])
    figures = json.loads(capsys.readouterr().out)
    assert (figures["plugin"], figures["library"]) == ("cmg_mj.gyro_free", "libcmg_mj_gyro_free.so")
    subprocess.run(["make", "example"], cwd=folder, check=True, timeout=300, capture_output=True)
    trajectory = prepare(load_scenario("push_recovery", ["push=[]"], "gyro_free")).run().trajectory
    assert trajectory is not None
    for program in ([sys.executable, "gyro_free_example.py"], ["./example"]):
        output = subprocess.run(program, cwd=folder, check=True, timeout=300, capture_output=True, text=True).stdout
        assert len(output.splitlines()) == 15
        assert output.split()[-2:] == [f"{trajectory['y1_rad'][-1]:.4f}", "rad"]
