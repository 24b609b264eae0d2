"""`cmg-mj identify`: what it prints and writes, and what it says to wrong input."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.scenario.rig_file import load_rig
from tests.command import ROOT, cmg_mj
from tests.features.identify.simulated import simulated_log, swaying

COLUMNS = ("--columns", "time=time_s,tilt=tilt_rad,rate=rate_rad_s", "--accelerometer", "x1,y1")


@pytest.fixture
def log(elsewhere: None) -> dict[str, float]:
    """A log in an empty folder; returns what is true."""
    for name, seed in (("log", 1), ("other", 2)):
        # The other log has the same rig: the same seed, and another motion.
        time, tilt = swaying(15.0)
        channels, columns, truth = simulated_log(time, tilt if seed == 1 else tilt[::-1], 1, n_accelerometers=1)
        values = {"tilt_rad": columns["tilt"], "rate_rad_s": columns["rate"], "x1": columns["x1"], "y1": columns["y1"]}
        rows = np.column_stack([channels.dt * np.arange(len(values["x1"])), *values.values()])
        np.savetxt(f"{name}.csv", rows, delimiter=",", header="time_s," + ",".join(values), comments="")
    return truth


@pytest.mark.slow
def test_writes_a_rig_that_replay_takes(log: dict[str, float]) -> None:
    outcome = cmg_mj("identify", "log.csv", *COLUMNS, "--judge", "other.csv", "--json")
    assert outcome.err == "cmg-mj: Written to rig.toml. Use it: cmg-mj replay log.csv --rig rig.toml\n"
    figures = json.loads(outcome.out)
    up = figures["parameters"]["accelerometer 1 up"]
    assert up["low"] < log["accelerometer 1 up"] < up["high"]
    assert figures["r_squared"]["other (judges)"]["angular acceleration by accelerometers and tilt"] > 0.98
    rig = load_rig("rig.toml")
    assert rig.accelerometer[0].place_m[1] == pytest.approx(up["value"], rel=1e-5)
    assert rig.log["scale"]["rate"] == pytest.approx(1.0 / log["gyro scale"], rel=0.05)
    assert rig.log["delay_s"] == pytest.approx(log["gyro delay"], abs=1e-3)
    assert Path("rig.png").stat().st_size > 10_000
    assert cmg_mj("replay", "other.csv", "--rig", "rig.toml", "--observers", "gyro_free", "--json").status == 0
    again = cmg_mj("identify", "log.csv", *COLUMNS)
    assert again.complaint == "-o rig.toml: rig.toml exists; give another name, or --overwrite"


RIG = """rate_hz = 100
[[accelerometer]]
columns = ["x1", "y1"]
place_m = [0.02, 0.165]
angle_deg = 90
noise_m_s2 = 0.03
[[accelerometer]]
columns = ["x2", "y2"]
place_m = [-0.03, 0.05]
noise_m_s2 = 0.04
[delays_s]
x1 = 0.004
y1 = 0.004
[pendulum]
inertia = 0.2
gravity_torque = 8.0
momentum = 0.6
"""


def test_a_scenario_and_a_robot_take_a_rig_file(elsewhere: None) -> None:
    """Noise and delay are those of both in the mean."""
    Path("rig.toml").write_text(RIG)
    lines = cmg_mj("check", "push_recovery", "--rig", "rig.toml", "--set", "plant.tilt_gravity_n_m=7").out
    assert "inertia 0.2 kg m^2, gravity 7 N m, momentum 0.6 N m s" in lines
    assert "accelerometers at (-0.03, 0.05) and (0.02, 0.165) m" in lines
    robot = ROOT / "examples/robots/torso.xml"
    cmg_mj("mount", robot, "--body", "torso", "--axis", "x", "--quick", "--rig", "rig.toml")
    fields = tomllib.loads(Path("balanced.toml").read_text())
    assert fields["plant"]["accelerometer_outer_angle_deg"] == 90
    assert "tilt_inertia_kg_m2" not in fields["plant"]
    density = math.sqrt(0.03**2 + 0.04**2) / math.sqrt(2.0) / math.sqrt(50.0) / 9.80665e-6
    accelerometer = fields["sensors"]["accelerometer"]
    assert accelerometer == pytest.approx({"noise_density_ug_rthz": density, "latency_s": 0.002}, rel=1e-5)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("rate_hz = 100", "", "--rig rig.toml: rate_hz: give the samples a second, of which noise_m_s2 is"),
        (
            RIG[RIG.rindex("[[acc") : RIG.index("[del")],
            "",
            "--rig rig.toml: accelerometer: has 1; a simulated rig has two",
        ),
    ],
)
def test_a_rig_that_no_scenario_can_have(elsewhere: None, old: str, new: str, complaint: str) -> None:
    Path("rig.toml").write_text(RIG.replace(old, new))
    assert cmg_mj("run", "push_recovery", "--rig", "rig.toml").complaint.startswith(complaint)


def test_milliseconds_are_not_taken_for_seconds(log: dict[str, float]) -> None:
    heading, *rows = Path("log.csv").read_text().splitlines()
    cells = [row.split(",", 1) for row in rows]
    stamped = [f"{1_732_700_000_000 + round(1e3 * float(time))},{rest}" for time, rest in cells]
    Path("log.csv").write_text("\n".join([heading.replace("time_s", "stamp"), *stamped]))
    columns = "time=stamp,tilt=tilt_rad,rate=rate_rad_s"
    assert "Say it, --units time=ms" in cmg_mj("identify", "log.csv", "--columns", columns).complaint


def test_the_delay_of_a_real_gyro(elsewhere: None) -> None:
    log = ROOT / "examples/data/stepper_encoder_gyro.csv"
    columns = "time=time_s,tilt=encoder_rad,rate=gyr_y_rad_s"
    figures = json.loads(cmg_mj("identify", log, "--columns", columns, "--json").out)["parameters"]
    assert figures["gyro delay"]["value"] == pytest.approx(0.0121, abs=1e-4)  # by correlation: docs/replay.md
    ratio = figures["tilt scale"]["value"] / figures["gyro scale"]["value"]
    assert ratio == pytest.approx(1.0157, abs=0.003)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--accelerometer", "x1"), "--accelerometer x1: write the headings of its two axes"),
        (("--accelerometer", "x1,y1", "-o", "rig.txt"), "-o rig.txt: a rig file ends in .toml"),
        (("-o", "theirs.toml"), "-o theirs.toml: is there, and not by this command: give another name"),
        (("--accelerometer", "x1,y1", "--columns", "time=time_s"), "--columns: name what shows the motion: tilt"),
        (("--columns", "time=time_s,tilt=tilt_rad"), "--accelerometer: give the columns of one, or both tilt and rate"),
    ],
)
def test_wrong_input_is_one_line(log: dict[str, float], arguments: tuple[str, ...], complaint: str) -> None:
    Path("theirs.toml").write_text("a = 1\n")
    assert cmg_mj("identify", "log.csv", *arguments).complaint.startswith(complaint)
