"""The refusals of mount, in one line that says what, where and what would do."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting import mount
from tests.command import cmg_mj
from tests.features.mounting.robots import EXAMPLES

pytestmark = pytest.mark.usefixtures("elsewhere")

POLE = """
<mujoco>
  <option timestep="{step}" {option}><flag {flag}/></option>
  <worldbody>
    <geom type="plane" size="4 4 0.1"/>
    <body name="pole" pos="0 0 0.5">
      <joint name="{hinge}" axis="{axis}" {limits}/>
      <joint name="twist" axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 0 0 {length}" size="0.03" mass="2"/>
      <body name="arm" pos="0 0 0.6"><joint name="elbow" axis="0 1 0"/>
        <geom name="hand" type="box" size="0.03 0.03 0.03" mass="0.2"/></body>
    </body>
    {more}
  </worldbody>
  {after}
</mujoco>
"""
TORSO = EXAMPLES / "torso.xml"


def pole(**changes: str) -> mujoco.MjSpec:
    fields = {"step": "0.002", "option": "", "flag": 'warmstart="enable"', "hinge": "ankle", "axis": "0 1 0"}
    fields |= {"limits": "", "length": "0.8", "more": "", "after": ""}
    return mujoco.MjSpec.from_string(POLE.format(**(fields | changes)))


def torso(*replacements: tuple[str, str]) -> mujoco.MjSpec:
    text = TORSO.read_text(encoding="utf-8")
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    return mujoco.MjSpec.from_string(text)


SIDEWAYS = '<body name="torso" pos="0 0 0.75">', '<body name="torso" pos="0 0 0.75" euler="90 0 0">'
FOOT = '<joint name="front_hip"', '<geom type="box" size="0.2 0.2 0.02" pos="0 0 -0.54"/><joint name="front_hip"'
LYING = 'keyframe><key name="lying" qpos="0 0 0.2 0.7071 0.7071 0 0 0 0"/></keyframe></mujoco'
NO_FLOOR = '<geom name="floor" type="plane" size="4 4 0.1" rgba="0.8 0.82 0.85 1"/>', ""

REFUSALS: dict[str, tuple[mujoco.MjSpec, dict[str, Any], str]] = {
    "an unknown body": (pole(), {"body": "pol"}, "--body pol: no such body; did you mean 'pole'. its bodies"),
    "an unknown hinge": (pole(), {"axis": "ankel"}, "--axis ankel: .*did you mean 'ankle'"),
    "along gravity": (pole(), {"axis": "z"}, "--axis z: lies along gravity"),
    "a hinge along gravity": (pole(), {"axis": "twist"}, "hinge 'twist': lies along gravity"),
    "no hinge there": (pole(), {"axis": "x"}, "body 'pole' has no hinge along it.*--free-base"),
    "three numbers": (pole(), {"axis": (0.0, 0.0, 0.0)}, "must be x, y, three numbers that are not all 0"),
    "unknown released joint": (
        pole(),
        {"release": ["elbo"]},
        "--release elbo: no such joint; did you mean 'elbow'",
    ),
    "an unknown keyframe": (pole(), {"keyframe": "home"}, "--keyframe home: no such keyframe"),
    "modules": (pole(), {"modules": 0}, "--modules 0: must be from 1 to 16"),
    "scale": (pole(), {"scale": math.nan}, "--scale nan: must be from 0.05 to 20"),
    "name": (pole(), {"name": "a/b"}, "--name a/b: must be a word"),
    "position": (pole(), {"position": (0.0, 0.0)}, "--position .*: must be three numbers"),
    "hold": (pole(), {"hold": "constraint"}, "--hold = constraint: did you mean 'constraints'"),
    "base": (pole(), {"base": "fre"}, "base = fre: did you mean 'free'"),
    "no inertia": (
        pole(more='<body name="ghost"><geom size="0.1" contype="0" conaffinity="0" mass="0"/></body>'),
        {"body": "ghost"},
        "--body ghost: has no mass",
    ),
    "constraints off": (pole(flag='constraint="disable"'), {}, '<flag constraint="disable"/> switches off'),
    "a closed chain": (
        pole(after='<equality><connect name="c" body1="arm" anchor="0 0 0"/></equality>'),
        {},
        "<connect> ties 'arm' and 'the world' together: a closed chain",
    ),
    "a name that is taken": (
        pole(more='<site name="fog"/>'),
        {},
        "has an element 'fog' already, which a mounted pair brings: rename it",
    ),
    "a keyframe of that name": (
        pole(after='<keyframe><key name="equilibrium" qpos="0 0 0"/></keyframe>'),
        {},
        "has a keyframe 'equilibrium' already",
    ),
    "beyond its range": (
        pole(axis="0 1 0", limits='range="50 90"'),
        {},
        "would stand upright at .* beyond its range",
    ),
    "a floor there is not": (torso(NO_FLOOR), {"body": "torso", "axis": "x"}, "has nothing to stand on"),
    "feet that stand": (torso(FOOT), {"body": "torso", "axis": "x"}, "stands by itself: .* wide across the axis"),
    "lying down": (torso(SIDEWAYS), {"body": "torso", "axis": "x"}, "falls over|does not come to stand|stands by"),
    "a keyframe that falls over": (
        torso(("</mujoco", "<" + LYING)),
        {"body": "torso", "axis": "x", "keyframe": "lying"},
        "falls over: where it stands its mass lies|falls over while it settles|stands by itself",
    ),
    "no room above the floor": (
        torso(),
        {"body": "torso", "axis": "x", "position": (0.0, 0.0, -0.7)},
        "no room: the modules reach .* m below its support",
    ),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refused_in_one_line(case: str) -> None:
    spec, options, message = REFUSALS[case]
    arguments: dict[str, Any] = {"body": "pole", "axis": "y"} | options
    with pytest.raises(InputError, match=message) as info:
        mount(spec, **arguments)
    assert "\n" not in str(info.value)


def test_an_axis_that_is_there_already() -> None:
    spec = mount(pole(), "pole").spec
    with pytest.raises(InputError, match="has an axis already: give the new one a name, such as --name pitch"):
        mount(spec, "pole")
    named_spec = mount(pole(), "pole", name="pitch").spec
    with pytest.raises(InputError, match="has an element 'pitch/tilt' already"):
        mount(named_spec, "pole", name="pitch")


def test_a_file_that_is_no_robot() -> None:
    Path("broken.xml").write_text("<mujoco><worldbody><body", encoding="utf-8")
    Path("empty.xml").write_text("", encoding="utf-8")
    for name, complaint in (
        ("none.xml", "no such file"),
        ("broken.xml", "XML parse error"),
        ("empty.xml", "not a model"),
    ):
        assert complaint in cmg_mj("mount", name, "--body", "torso").complaint
    assert not Path("balanced.xml").exists()
