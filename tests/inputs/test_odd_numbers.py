"""Numbers at the ends of what numbers reach, in models and in options: one line, and no warning of NumPy's."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.replay.reference import alignment
from tests.command import cmg_mj
from tests.inputs.complaints import assert_in_order, table
from tests.inputs.test_model_file import check_edited
from tests.plant.mounting.robots import EXAMPLES

TORSO = (EXAMPLES / "torso.xml").read_text(encoding="utf-8")
WIDER = "is wider than numbers reach; sizes are at most 1e+30"


@table(
    ("steps of 0", ('step="0.002"', 'step="0"'), '<option timestep="0"/>: must be at least 1e-06 s'),
    ("steps back", ('step="0.002"', 'step="-1"'), '<option timestep="-1"/>: must be at least 1e-06 s'),
    ("steps that are none", ('step="0.002"', 'step="nan"'), '<option timestep="nan"/>: must be at least'),
    ("steps of nothing", ('step="0.002"', 'step="1e-300"'), '<option timestep="1e-300"/>: must be at least'),
    ("hardly any gravity", ("<option ", '<option gravity="0 0 -1e-10" '), "falls too slowly, with 0.00036 1/s; a pair"),
    ("gravity without end", ("<option ", '<option gravity="0 0 -1e300" '), "its physics fails while it settles"),
    ("gravity that is none", ("<option ", '<option gravity="0 0 nan" '), 'gravity="0 0 nan"/> does not pull down'),
)
def test_of_a_robot(wrong_input: tuple[str, str], fragments: list[str]) -> None:
    Path("robot.xml").write_text(TORSO.replace(*wrong_input), encoding="utf-8")
    arguments = ("mount", "robot.xml", "--body", "torso", "--axis", "x", "--scale", "1.3")
    assert_in_order(["robot.xml: ", *fragments], cmg_mj(*arguments).complaint)
    assert os.listdir() == ["robot.xml"]


@table(
    (
        "a kilometre up",
        ["--position", "0 0 1000"],
        "falls too slowly, with 0.099 1/s; a pair is for robots that fall with 0.69",
    ),
    ("far up", ["--position", "0 0 1e10"], "does not compile: its masses and inertias are of too different sizes"),
    ("beyond all numbers", ["--position", "0 0 1e308"], "its physics fails while it settles on the floor"),
    ("nowhere", ["--position", "0 0 nan"], "--position [0.0, 0.0, nan]: must be three numbers"),
    ("a direction of any size", ["--axis", "1e308 1e308 0"], "its physics fails while it settles on the floor"),
    ("a direction of no size", ["--axis", "0 1e-200 0"], "three numbers that are not all 0"),
    ("modules without end", ["--modules", "9" * 30], "--modules 9999", ": must be from 1 to 16"),
    ("a scale that is none", ["--scale", "nan"], "--scale nan: must be from 0.05 to 20"),
)
def test_of_a_mount(wrong_input: list[str], fragments: list[str]) -> None:
    Path("robot.xml").write_text(TORSO, encoding="utf-8")
    arguments = ("mount", "robot.xml", "--body", "torso", "--axis", "x", "--scale", "1.3", *wrong_input)
    assert_in_order(fragments, cmg_mj(*arguments).complaint)
    assert os.listdir() == ["robot.xml"]


def test_a_rig_that_runs_away_within_a_sample() -> None:
    beyond = "plant.model = 'rig.xml': its reduced model runs beyond all numbers within a sample of 0.005 s; gravity, "
    assert beyond in check_edited(rig=("0 0 -9.81", "0 0 -1e10")).complaint
    for command in (("check", "rig.xml"), ("run", "push_recovery", "--set", "plant.model=rig.xml")):
        assert beyond in cmg_mj(*command).complaint


@table(
    ("from end to end", "-1e308:1e308:3", f"-1e+308 to 1e+308 {WIDER}"),
    ("from end to end, sampled", "-1e308:1e308", f"-1e+308 to 1e+308 {WIDER}"),
    ("to infinity", "0:1e309:3", "an empty range; its ends must be two different numbers"),
    ("from none", "nan:1:3", "an empty range; its ends must be two different numbers"),
    ("of very small ones", "0:1e-320:3", "sizes are from 1e-30 to 1e+30"),
    ("of very large ones", "1e300:1e301:2", "= 1e+300: must be a number greater than -45"),
    ("of very many", "0:1:99999999999999999999", "99999999999999999999 values; a range has at least 2, at most 10000"),
    ("of fewer than none", "0:1:-1", "-1 values; a range has at least 2"),
    ("of half a value", "0:1:1e3", "'0:1:1e3' is no range"),
    ("without end", "1:" * 5000, "is no range; write first:last:count"),
)
def test_ranges(wrong_input: str, fragments: list[str]) -> None:
    vary = f"plant.equilibrium_bias_deg={wrong_input}"
    complaint = cmg_mj("sweep", "push_recovery", "--vary", vary, "--worlds", "1").complaint
    assert_in_order(["--vary plant.equilibrium_bias_deg", *fragments], complaint)
    assert len(complaint) < 2000
    assert os.listdir() == []


@table(
    ("a delay of ages", ["--delay", "1e308"], "--delay 1e+308: must be from -1e+06 to 1e+06 s"),
    ("a delay back by ages", ["--delay", "-1e308"], "--delay -1e+308: must be from -1e+06 to 1e+06 s"),
    ("a delay that is none", ["--delay", "nan"], "--delay nan: must be from -1e+06 to 1e+06 s"),
    ("settling for ages", ["--settle-s", "1e308"], "log: nothing is left to score: "),
    ("no settling", ["--settle-s", "nan"], "--settle-s nan: must be a number of seconds not below 0"),
    ("a role of any length", ["--columns", f"{'a' * 100_000}=x"], "--columns aaaa", "... no such role; allowed: "),
    ("a heading of any length", ["--columns", f"gimbal={'a' * 100_000}_deg"], "log.csv: has no column 'aaaa"),
)
def test_of_a_log(wrong_input: list[str], fragments: list[str]) -> None:
    rows = "\n".join(f"{0.01 * i:.2f},{i % 7},{i % 5}" for i in range(200))
    Path("log.csv").write_text(f"t_s,tilt_deg,rate_dps\n{rows}\n", encoding="utf-8")
    columns = ("--columns", "time=t_s,tilt=tilt_deg,rate=rate_dps")
    complaint = cmg_mj("replay", "log.csv", *columns, "--observers", "linear", *wrong_input).complaint
    assert_in_order(fragments, complaint)
    assert len(complaint) < 2000
    assert os.listdir() == ["log.csv"]


def test_a_log_of_very_many_columns() -> None:
    names = ",".join(f"c{i}" for i in range(2000))
    Path("log.csv").write_text(f"{names}\n{','.join(['0'] * 2000)}\n", encoding="utf-8")
    complaint = cmg_mj("replay", "log.csv", "--columns", "tilt=tilt_deg").complaint
    assert_in_order(["has no column 'tilt_deg'; it has: 'c0', 'c1', ", " more"], complaint)
    assert len(complaint) < 1200


@pytest.mark.parametrize("n", [200, 30_000, 300_000])
def test_a_reference_that_says_nothing_is_compared_without_a_warning(n: int) -> None:
    """Over the span that they are compared over, this rate's integral is the same everywhere but for rounding."""
    rows = np.arange(n)
    compared = alignment([np.radians(rows % 7)], [np.radians(rows % 5)], 0.01)
    assert (compared.scale, compared.offset_rad_s, compared.correlation) == (None, None, None)
