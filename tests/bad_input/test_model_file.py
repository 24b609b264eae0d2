"""Models that lack something or have it otherwise: one clear line that names it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from cmg_mj import load_plant
from cmg_mj.resources import folder
from tests.bad_input.complaints import assert_in_order, check, table
from tests.command import Said, cmg_mj


def edited(rig: tuple[str, str] | None = None, cube: tuple[str, str] | None = None) -> Said:
    """`check` on a copy of the bundled model, in which a pattern has been replaced."""
    for name, edit in (("scissored_pair.xml", rig), ("cube.xml", cube)):
        text = (folder("models") / name).read_text()
        if edit:
            text, count = re.subn(edit[0], edit[1], text, flags=re.DOTALL)
            assert count, f"{edit[0]} does not occur in {name}"
        Path(name.replace("scissored_pair", "rig")).write_text(text)
    return check("duration_s = 0.1\n[plant]\nmodel = 'rig.xml'")


def without(start: str) -> tuple[str, str]:
    return rf"<{start}.*?/>", ""


BODY = '<body name="more" pos="1 0 0">{}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>'


@table(
    (
        "joint tilt",
        {"rig": without('joint name="tilt"')},
        "the model has no joint 'tilt'; its joints: cube1/flywheel, ",
    ),
    ("typo in tilt", {"rig": ('"tilt"', '"tlit"')}, "the model has no joint 'tilt'; did you mean 'tlit'?"),
    (
        "joint flywheel",
        {"cube": without('joint name="flywheel"')},
        "has no joint 'cube1/flywheel'; its joints: cube1/g",
    ),
    ("joint gimbal", {"cube": without('joint name="gimbal"')}, "the model has no joint 'cube1/gimbal'"),
    (
        "actuator servo",
        {"cube": without("intvelocity")},
        "has no actuator 'cube1/gimbal_servo'; its actuators: cube1/f",
    ),
    ("actuator motor", {"cube": without("velocity name")}, "the model has no actuator 'cube1/flywheel_motor'"),
    ("sensor encoder", {"cube": without("jointpos")}, "the model has no sensor 'cube1/gimbal_encoder'"),
    ("accelerometer", {"rig": without('accelerometer name="accelerometer_inner"')}, "no sensor 'accelerometer_inner'"),
    ("gyro", {"rig": without("gyro")}, "the model has no sensor 'fog'; its sensors: accelerometer_inner"),
    (
        "keyframe",
        {"rig": ("<keyframe>.*</keyframe>", "")},
        "the model has no keyframe 'equilibrium'; its keyframes: none",
    ),
    ("typo in keyframe", {"rig": ('"equilibrium"', '"equilibrum"')}, "'equilibrium'; did you mean 'equilibrum'?"),
    ("cubes", {"rig": ('<frame name="cube..mount.*?</frame>', "")}, "the model has no joint 'cube1/gimbal'"),
    ("the cube's file", {"rig": ('file="cube.xml"', 'file="cub.xml"')}, "not a model MuJoCo can read: ", "cub.xml"),
)
def test_a_model_that_lacks(given: dict[str, Any], fragments: list[str]) -> None:
    assert_in_order(["my.toml: rig.xml: ", *fragments], edited(**given).complaint)


@table(
    ("an end", {"rig": ("<keyframe>.*", "")}, "not a model MuJoCo can read: XML syntax error at line "),
    ("nothing", {"rig": (".*", "")}, "not a model MuJoCo can read: ", "empty file"),
    ("no XML", {"rig": (".*", "a = 1")}, "not a model MuJoCo can read: XML syntax error at line 1"),
    ("an unknown element", {"rig": ("<headlight", "<headlite")}, "unrecognized element", "'headlite', line 20"),
    ("a free joint", {"rig": ("</worldbody>", BODY.format('<freejoint name="j"/>'))}, "joint 'j' must be a hinge"),
    ("a slide", {"rig": ('name="yaw" type="hinge"', 'name="yaw" type="slide"')}, "joint 'yaw' must be a hinge"),
    ("no name", {"rig": ("</worldbody>", BODY.format("<joint/>"))}, "the joint of body 'more' has no name"),
    ("a tilt about x", {"rig": ('name="tilt" type="hinge" axis="0 1 0"', 'name="tilt"')}, "'tilt' must turn about y"),
    (
        "a servo on the flywheel",
        {"cube": ('name="gimbal_servo" joint="gimbal"', 'name="gimbal_servo" joint="flywheel"')},
        "actuator 'cube1/gimbal_servo' must drive the joint 'cube1/gimbal'",
    ),
    (
        "an encoder on the flywheel",
        {"cube": ('name="gimbal_encoder" joint="gimbal"', 'name="gimbal_encoder" joint="flywheel"')},
        "sensor 'cube1/gimbal_encoder' must be the jointpos of 'cube1/gimbal'",
    ),
    ("another gyro", {"rig": ("<gyro(.*?)/>", r"<velocimeter\1/>")}, "sensor 'fog' must be of the kind 'gyro'"),
    (
        "an accelerometer that lies on its side",
        {"rig": ('(name="accelerometer_outer" pos="[^"]*") euler="[^"]*"', r"\1")},
        "the site of sensor 'accelerometer_outer' must have its y axis along the tilt axis",
    ),
    (
        "accelerometers the wrong way round",
        {"rig": ('name="accelerometer_inner" pos="[^"]*"', 'name="accelerometer_inner" pos="0.3 0 0.3"')},
        "accelerometer_outer must lie farther from the tilt axis than accelerometer_inner",
    ),
    (
        "a keyframe without speed",
        {"rig": ("ctrl=.0 314 0 -314.", "")},
        "'equilibrium' must give 'cube1/flywheel_motor' a",
    ),
    ("a speed that is none", {"rig": ("ctrl=.0 314 0", 'ctrl="0 nan 0')}, "must give 'cube1/flywheel_motor' a speed"),
    (
        "a keyframe upside down",
        {"rig": ("qpos=.0 -0.78539816339744828", 'qpos="0 2.356')},
        "the rig must stand upright",
    ),
    ("no mass", {"cube": ('mass="0.61"', 'mass="0"')}, "does not compile: mass and inertia", "'cube1/flywheel'"),
)
def test_a_model_that_has(given: dict[str, Any], fragments: list[str]) -> None:
    assert_in_order(["my.toml: rig.xml: ", *fragments], edited(**given).complaint)


def test_the_unedited_copy_is_a_model() -> None:
    assert edited().status == 0


def test_a_lock_without_a_bearing() -> None:
    edited(rig=('<joint name="yaw".*?/>', ""))
    complaint = cmg_mj("run", "my.toml", "--set", "plant.lock_thrust_bearing=true").complaint
    assert "plant.lock_thrust_bearing = true: rig.xml has no joint 'yaw' to lock" in complaint


def test_a_lock_where_the_keyframe_gives_no_rates() -> None:
    edited(rig=('qvel="[^"]*"', ""))
    assert load_plant(model="rig.xml", lock_thrust_bearing=True).yaw is None
