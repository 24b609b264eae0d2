"""Models that lack something or have it otherwise: one clear line that names it."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import mujoco
import pytest

from cmg_mj import load_plant
from cmg_mj.core.errors import InputError
from cmg_mj.inputs.files import folder
from tests.command import CommandOutcome, cmg_mj
from tests.inputs.complaints import assert_in_order, check, table


def check_edited(rig: tuple[str, str] | None = None, cube: tuple[str, str] | None = None) -> CommandOutcome:
    """`check` on a copy of the bundled model, in which a pattern has been replaced."""
    for name, edit in (("scissored_pair.xml", rig), ("cube.xml", cube)):
        text = (folder("models") / name).read_text()
        if edit:
            text, count = re.subn(edit[0], edit[1], text, flags=re.DOTALL)
            assert count, f"{edit[0]} does not occur in {name}"
        Path(name.replace("scissored_pair", "rig")).write_bytes(text.encode("latin-1"))
    return check("duration_s = 0.1\n[plant]\nmodel = 'rig.xml'")


def delete_element(start: str) -> tuple[str, str]:
    return rf"<{start}.*?/>", ""


KEYFRAME_ANGLES = r"-0.78539816339744828 1.5707963267948966 0 1.5707963267948966"
"""The keyframe's angles of tilt, gimbal, flywheel and gimbal."""
BODY = '<body name="more" pos="1 0 0">{}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>'


@table(
    (
        "joint tilt",
        {"rig": delete_element('joint name="tilt"')},
        "the model has no joint 'tilt'; its joints: cube1/flywheel, ",
    ),
    ("typo in tilt", {"rig": ('"tilt"', '"tlit"')}, "the model has no joint 'tilt'; did you mean 'tlit'?"),
    (
        "joint flywheel",
        {"cube": delete_element('joint name="flywheel"')},
        "has no joint 'cube1/flywheel', 'cube2/flywheel'; its joints: cube1/g",
    ),
    (
        "actuator servo",
        {"cube": delete_element("intvelocity")},
        "has no actuator 'cube1/gimbal_servo', 'cube2/gimbal_servo'; its actuators: cube1/f",
    ),
    ("sensor encoder", {"cube": delete_element("jointpos")}, "the model has no sensor 'cube1/gimbal_encoder'"),
    (
        "accelerometer",
        {"rig": delete_element('accelerometer name="accelerometer_inner"')},
        "no sensor 'accelerometer_inner'",
    ),
    (
        "keyframe",
        {"rig": ("<keyframe>.*</keyframe>", "")},
        "the model has no keyframe 'equilibrium'; its keyframes: none",
    ),
    ("the cube's file", {"rig": ('file="cube.xml"', 'file="cub.xml"')}, "not a model MuJoCo can read: ", "cub.xml"),
    ("an end", {"rig": ("<keyframe>.*", "")}, "not a model MuJoCo can read: XML parse error "),
    ("an unknown element", {"rig": ("<headlight", "<headlite")}, "unrecognized element", "'headlite', line 20"),
    (
        "a gimbal that slides",
        {"cube": ('joint name="gimbal" type="hinge"', 'joint name="gimbal" type="slide"')},
        "joint 'cube1/gimbal' must be a hinge",
    ),
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
        {"rig": ('(name="accelerometer_outer" pos="[^"]*") euler="[^"]*"', r'\1 euler="0 0 90"')},
        "the site of sensor 'accelerometer_outer' must have its y axis along the tilt axis",
    ),
    (
        "accelerometers the wrong way round",
        {"rig": ('name="accelerometer_inner" pos="[^"]*"', 'name="accelerometer_inner" pos="0.3 0 0.3"')},
        "accelerometer_outer must lie farther from the tilt axis than accelerometer_inner, or beside it",
    ),
    (
        "a keyframe without speed",
        {"rig": ("ctrl=.0 314 0 -314.", "")},
        "'equilibrium' must give 'cube1/flywheel_motor' a",
    ),
    (
        "a speed that is none",
        {"rig": ("ctrl=.0 314 0", 'ctrl="0 nan 0')},
        "ctrl of key 'equilibrium' is no number of any size",
    ),
    (
        "a keyframe upside down",
        {"rig": ("qpos=.0 -0.78539816339744828", 'qpos="0 2.356')},
        "the rig must stand upright",
    ),
    ("no mass", {"cube": ('mass="0.61"', 'mass="0"')}, "does not compile: mass and inertia", "'cube1/flywheel'"),
    ("no gravity", {"rig": ("0 0 -9.81", "0 0 0")}, "<option gravity='0 0 0'>: must point straight down"),
    ("gravity aslant", {"rig": ("0 0 -9.81", "0 9.81 -9.81")}, "<option gravity='0 9.81 -9.81'>: must point straight"),
    (
        "a place that is none",
        {"rig": ('outer" pos="0.14250000000000004', 'outer" pos="nan')},
        "'accelerometer_outer' is",
    ),
    ("a servo that is none", {"cube": ("85.6", "nan")}, "gainprm of actuator 'cube1/gimbal_servo' is no number"),
    ("a mass of any size", {"cube": ('mass="1.66"', 'mass="1e300"')}, "mass of body 'frame' is no number of any size"),
    (
        "a keyframe that lies flat",
        {"rig": (KEYFRAME_ANGLES, "0.78539816339744828 1.5707963267948966 0 1.5707963267948966")},
        "the rig must stand upright, its mass above the tilt axis; it leans by 90 deg ('tilt' = -0.785398 would be up",
    ),
    (
        "gimbals a quarter turn off",
        {"rig": (KEYFRAME_ANGLES, "-0.78539816339744828 0 0 0")},
        "the axis of 'cube1/flywheel' must be at right angles to the tilt's; it is 90 deg off ('cube1/gimbal' = ",
        "the axis of 'cube2/flywheel'",
        "keyframe 'equilibrium' must have the setpoint (act) of 'cube2/gimbal_servo' where its gimbal stands: 0, not",
    ),
    ("no setpoints", {"rig": (' act="1[^"]*"', "")}, "must have the setpoint (act) of 'cube1/gimbal_servo' where"),
    (
        "flywheels at rest",
        {"rig": ('qvel="[^"]*"', "")},
        "start 'cube1/flywheel' at its motor's speed: qvel says 0, ctrl",
    ),
    ("a tilt that moves", {"rig": ('qvel="0 0', 'qvel="0 1')}, "only flywheels may turn, not 'tilt' (1 rad/s)"),
    (
        "a centre of mass 3 cm beside the line",
        {"rig": ('_mount" pos="0.095', '_mount" pos="0.125')},
        "it leans by 7.77 deg ('tilt' = -0.920926 would be upright)",
    ),
    (
        "a mesh that is none",
        {"rig": ("<asset>", '<asset><mesh name="rig" file="rig.xml"/>')},
        "does not compile: no decoder found for mesh file 'rig.xml'",
    ),
    ("a model that is no text", {"rig": ("sun", "sun\xff")}, "not UTF-8 text (at byte "),
    ("a part that is no text", {"cube": ("<!--", "<!--\xff")}, "cube.xml: not UTF-8 text (at byte "),
)
def test_a_model_that_is_wrong_is_named_with_what_is_wrong(wrong_input: dict[str, Any], fragments: list[str]) -> None:
    assert_in_order(["my.toml: rig.xml: ", *fragments], check_edited(**wrong_input).complaint)


def test_the_unedited_copy_is_a_model() -> None:
    assert check_edited().status == 0


def test_a_lock_without_a_bearing() -> None:
    check_edited(rig=('<joint name="yaw".*?/>', ""))
    complaint = cmg_mj("run", "my.toml", "--set", "plant.lock_thrust_bearing=true").complaint
    assert "plant.lock_thrust_bearing = true: rig.xml has no joint 'yaw' to lock" in complaint


def test_a_lock_where_the_keyframe_gives_no_rates() -> None:
    check_edited(rig=('qvel="[^"]*"', ""))
    with pytest.raises(
        InputError, match=r"^rig\.xml: keyframe 'equilibrium' must start 'cube1/flywheel' at its motor's"
    ):
        load_plant(model="rig.xml", lock_thrust_bearing=True)


def test_a_file_that_is_no_text() -> None:
    Path("my.xml").write_bytes(b"<mujoco>\xff</mujoco>")
    assert cmg_mj("check", "my.xml").complaint == "my.xml: not UTF-8 text (at byte 8); save it as UTF-8"


def test_all_that_is_missing_is_said_at_once() -> None:
    check_edited()
    rig = Path("rig.xml").read_text()
    for edit in (
        ('name="fog" site', 'name="fg" site'),
        ('"tilt"', '"tlit"'),
        ("<key name.*?/>", ""),
    ):
        rig = re.sub(*edit, rig, count=1, flags=re.DOTALL)
    Path("rig.xml").write_text(rig)
    assert_in_order(
        [
            "rig.xml: the model has no joint 'tilt'; did you mean 'tlit'? its joints: ",
            "the model has no sensor 'fog'; did you mean 'fg'? its sensors: ",
            "the model has no keyframe 'equilibrium'; its keyframes: none",
            "a rig needs a joint or a site tilt, the joints MODULE/gimbal, MODULE/flywheel, the actuators ",
        ],
        cmg_mj("check", "rig.xml").complaint,
    )


def test_check_of_a_model_by_itself() -> None:
    check_edited()
    outcome = cmg_mj("check", "rig.xml")
    assert (outcome.status, outcome.err) == (0, "")
    for fragment in ("rig.xml: a rig", "cube1, cube2", "J_d = 0.0011 kg m^2", "--set plant.model=rig.xml"):
        assert fragment in outcome.out
    assert "hint" not in outcome.out
    assert "scissored_pair.xml: a rig" in cmg_mj("check", "scissored_pair.xml").out
    assert "the model has no joint 'tilt', 'cube1/gimbal', 'cube1/flywheel'" in cmg_mj("check", "cube.xml").complaint


def test_a_hint_for_momenta_that_do_not_cancel() -> None:
    hint = "momenta do not cancel while the thrust bearing is free"
    assert hint in cmg_mj("check", "single_gimbal.xml").out
    assert hint not in cmg_mj("check", "single_gimbal").out  # the scenario locks it


@pytest.mark.parametrize("name", ["my.xml", "outer.xml"])
def test_a_file_that_includes_itself(name: str) -> None:
    Path("outer.xml").write_text('<mujoco><asset><model file="my.xml"/></asset></mujoco>')
    Path("my.xml").write_text(f'<mujoco><asset><model name="a" file="{name}"/></asset></mujoco>')
    assert cmg_mj("check", "my.xml").complaint.startswith("my.xml: contains itself: my.xml in ")


@table(
    (
        "a stiff damper",
        "tilt_damping_n_m_s=1e6",
        "plant.tilt_damping_n_m_s = 1e+06: ",
    ),
    ("a huge mass", "flywheel_imbalance_kg_m=1e9", "plant.flywheel_imbalance_kg_m = 1e+09: "),
    ("a huge damper", "gimbal_damping_n_m_s=1e30", "plant.gimbal_damping_n_m_s = 1e+30: "),
)
@pytest.mark.parametrize("step", [[], ["--set", "plant.timestep_s=0.005"]])
def test_settings_that_no_physics_stands(wrong_input: str, fragments: list[str], step: list[str]) -> None:
    outcome = cmg_mj("run", "push_recovery", "--set", f"plant.{wrong_input}", *step)
    assert_in_order(fragments, outcome.complaint)
    assert not Path("runs").exists()


FREE = '<worldbody><body name="t"><freejoint/>{}</body></worldbody>'
MESH = '<asset><mesh name="m" file="{}"/></asset>' + FREE.format('<geom type="mesh" mesh="m"/>')
HOSTILE = {
    "a name with >": ('<asset><model name="a>b" file="my.xml"/></asset>', "my.xml: contains itself: my.xml in my.xml"),
    "a name that looks like a comment": (
        '<asset><model name="<!--" file="my.xml"/><model name="-->" file="none"/></asset>',
        "my.xml: contains itself: my.xml in my.xml",
    ),
    "an entity": ('<asset><model file="&#109;y.xml"/></asset>', "my.xml: contains itself: my.xml in my.xml"),
    "a pipe": (MESH.format("pipe.stl"), "my.xml: pipe.stl: is no ordinary file"),
    "a pipe without its path": (
        '<compiler strippath="true"/>' + MESH.format("no/pipe.stl"),
        "no/pipe.stl: is no ordinary",
    ),
    "a pipe in the folder of an included file": (
        '<include file="inner.xml"/>' + MESH.format("other.stl"),
        "is no ordinary",
    ),
    "a pipe that is included": ('<include file="pipe.stl"/>', "pipe.stl: is no ordinary file"),
    "a texture without end": (
        '<asset><texture type="cube" fileright="zero.png"/></asset>',
        "zero.png: is no ordinary file",
    ),
    "copies of copies": (
        FREE.format('<replicate count="1000"><replicate count="1000"><geom size="1"/></replicate></replicate>'),
        "my.xml: <replicate>: makes 1e+06 copies; at most 20,000 are read",
    ),
    "a composite": ('<worldbody><flexcomp count="999 999 999"/></worldbody>', "<flexcomp>: makes 9.97e+08 copies"),
    "a flex": (FREE.format('<flexcomp count="45 45 1"/>'), "<flexcomp>: makes 2.02e+03 copies; at most 20,000"),
    "a sign": (FREE.format('<replicate count="+1000000"/>'), "<replicate>: makes 1e+06 copies"),
    "many digits": (FREE.format(f'<replicate count="{"9" * 5000}"/>'), "<replicate>: makes inf copies"),
    "copies side by side": (
        FREE.format('<replicate count="9000"><geom size="1"/></replicate>' * 2),
        "<replicate>: makes 9e+03 copies; at most 20,000 are read in all",
    ),
    "free bodies": (
        '<worldbody><replicate count="2000"><body><joint type="free"/></body></replicate></worldbody>',
        "<joint>: makes 2e+03 copies; at most 20,000 are read in all, of free bodies and points of a flex 1,333",
    ),
    "behind a fault": ('</none><asset a="&nbsp;"><model name="a & b" file="my.xml"/></asset>', "contains itself"),
    "models in models": ('<include file="a.xml"/>', "my.xml: b.xml: <attach>: makes 1e+04 copies"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_model_that_would_crash_mujoco_or_never_end(case: str) -> None:
    text, message = HOSTILE[case]
    Path("sub").mkdir()
    for pipe in ("pipe.stl", "sub/other.stl"):
        os.mkfifo(pipe)
    Path("zero.png").symlink_to("/dev/zero")
    Path("inner.xml").write_text('<mujoco><compiler meshdir="sub"/></mujoco>')
    for name, inner in (("a", "b"), ("b", "c"), ("c", "d")):
        copies = f'<replicate count="100"><attach model="{inner}"/></replicate>'
        asset = f'<asset><model name="{inner}" file="{inner}.xml"/></asset>'
        Path(f"{name}.xml").write_text(f"<mujoco>{asset}<worldbody>{copies}</worldbody></mujoco>")
    Path("my.xml").write_text(f"<mujoco>{text}</mujoco>")
    assert message in cmg_mj("check", "my.xml").complaint


@pytest.mark.parametrize(
    ("before", "name", "after"),
    [
        ("\n<?xml version='1.0'?><!-- a -- 'b -->", "it's a>b", '<!-- " --></mujoco>'),
        ("", "R&D, a & b, &nbsp;, a<b, \1", "</mujoco>"),
        ("", "", "don't <!-- -- isn't --></mujoco><!-- twice --><mujoco/>"),
        ("<?xml version='1.0' encoding='ISO-8859-1'?>", "\N{DEGREE SIGN}", "</mujoco>\0"),
        ("<!DOCTYPE mujoco [<!ENTITY a 'b'>]>", "<![CDATA[", "<![CDATA[<include file='my.xml'/>]]></mujoco>"),
    ],
)
def test_what_mujoco_reads_is_read(before: str, name: str, after: str) -> None:
    """And not refused for what it says: much that is no XML."""
    copies = '<replicate count="500"><geom size="1"/></replicate>'
    text = f'{before}<mujoco><worldbody><body name="{name}"/>{copies}</worldbody>{after}'
    assert mujoco.MjSpec.from_string(text.rstrip("\0")).bodies
    Path("my.xml").write_text(text)
    assert "the model has no" in cmg_mj("check", "my.xml").complaint
