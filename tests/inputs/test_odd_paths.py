"""Paths, names and hosts that nobody means: one line that names them, however long or of whatever bytes."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cmg_mj.errors import InputError
from cmg_mj.plant.mounting import mount
from tests.command import cmg_mj
from tests.inputs.complaints import assert_in_order, table
from tests.plant.mounting.robots import EXAMPLES

BYTES, LONG = "a\udcff", "a" * 100_000
TORSO = ("--body", "torso", "--axis", "x")
NOT_TEXT = "the file's name is not UTF-8 text, and MuJoCo opens no such file"


@pytest.fixture(autouse=True)
def _robot() -> None:
    Path("robot.xml").write_bytes((EXAMPLES / "torso.xml").read_bytes())


@table(
    ("nobody's home to write to", ["robot.xml", "-o", "~nosuchuser/x.xml"], "-o ~nosuchuser/x.xml: no home folder"),
    (
        "nobody's home to read from",
        ["~nosuchuser/x.xml"],
        "ROBOT ~nosuchuser/x.xml: no home folder is known of ~nosuch",
    ),
    ("bytes to write to", ["robot.xml", "-o", f"{BYTES}.xml"], rf"-o 'a\udcff.xml': {NOT_TEXT}"),
    ("bytes to read from", [f"{BYTES}.xml"], r"'a\udcff.xml': no such file"),
    ("bytes for a toml", ["robot.xml", "-o", f"{BYTES}.toml"], rf"-o 'a\udcff.toml': {NOT_TEXT}"),
    ("a long name to write to", ["robot.xml", "-o", f"{LONG}.xml"], "aaaa", "... File name too long"),
    ("a long name to read from", [f"{LONG}.xml"], "aaaa", "... File name too long"),
    ("a device", ["/dev/zero"], "/dev/zero: is no ordinary file"),
    ("an empty device", ["/dev/null"], "/dev/null: is no ordinary file"),
    ("a folder", ["."], ".: is a folder"),
    ("below a file", ["robot.xml/x.xml"], "robot.xml/x.xml: no such file"),
    ("a pipe", ["pipe.xml"], "pipe.xml: is no ordinary file"),
    ("a circle of links", ["circle.xml"], "circle.xml: no such file"),
    ("a body of bytes", ["robot.xml", "--body", BYTES], f"--body {BYTES}: robot.xml has no such body; its bodies: "),
    ("an axis of bytes", ["robot.xml", "--axis", BYTES], f"--axis {BYTES}: must be x, y, three numbers, or a hinge"),
    ("a joint of bytes", ["robot.xml", "--release", BYTES], f"--release {BYTES}: robot.xml has no such joint; its"),
    ("a keyframe of bytes", ["robot.xml", "--keyframe", BYTES], f"--keyframe {BYTES}: robot.xml has no such keyframe"),
    ("a word of bytes", ["robot.xml", "--name", BYTES], f"--name {BYTES}: must be a word"),
    ("a long body", ["robot.xml", "--body", LONG], "--body aaaa", "... robot.xml has no such body; its bodies: "),
    ("a long observer", ["robot.xml", "--observer", LONG], "no such observer; allowed: adaptive, "),
)
def test_of_a_mount(wrong_input: list[str], fragments: list[str]) -> None:
    os.mkfifo("pipe.xml")
    os.symlink("circle.xml", "circle.xml")
    robot, *options = wrong_input
    complaint = cmg_mj("mount", robot, *TORSO, "--scale", "1.3", *options).complaint
    assert_in_order(fragments, complaint)
    assert len(complaint) < 2000
    assert sorted(os.listdir()) == ["circle.xml", "pipe.xml", "robot.xml"]


def test_a_robot_and_a_target_in_a_folder_whose_name_is_no_text() -> None:
    os.mkdir(b"\xff")
    os.chdir(b"\xff")
    Path("robot.xml").write_bytes((EXAMPLES / "torso.xml").read_bytes())
    for robot, target in ("robot.xml", "../b.xml"), ("../robot.xml", "b.xml"):
        complaint = cmg_mj("mount", robot, *TORSO, "-o", target).complaint
        assert r"the name of the folder '\udcff' in its path is not UTF-8 text" in complaint
    assert os.listdir() == ["robot.xml"]


def test_nobodys_home_in_python() -> None:
    with pytest.raises(InputError, match=r"~nosuchuser/x\.xml: no home folder is known of ~nosuchuser"):
        mount("~nosuchuser/x.xml", "torso")


@table(
    ("a device", "/dev/zero", "scenario '/dev/zero': is no ordinary file"),
    ("a pipe", "pipe.toml", "scenario 'pipe.toml': is no ordinary file"),
    ("a long name", LONG, "scenario 'aaaa", "... cannot be read: File name too long"),
    ("a long path", "a/" * 500, "scenario 'a/a/", "no such file, nor a bundled one; bundled: "),
)
@pytest.mark.parametrize("command", ["check", "run", "tune", "studio"])
def test_of_a_scenario(command: str, wrong_input: str, fragments: list[str]) -> None:
    os.mkfifo("pipe.toml")
    complaint = cmg_mj(command, wrong_input).complaint
    assert_in_order(fragments, complaint)
    assert len(complaint) < 2000


def test_a_host_of_a_cluster_that_is_none() -> None:
    vary = ("--vary", "plant.equilibrium_bias_deg=0,1", "--worlds", "1")
    complaint = cmg_mj("sweep", "push_recovery", *vary, "--cluster", "tcp://a..b:1").complaint
    assert complaint == "--cluster tcp://a..b:1: no name of a computer before the port"
