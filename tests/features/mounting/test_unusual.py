"""Rare elements of robots' files: each is mounted as the plain one is, or refused in one line."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting import MountedRobot, mount
from cmg_mj.features.mounting.stance import simulated_pole
from cmg_mj.plant.plant import Plant, load_plant
from tests.features.mounting.push_robots import CART_POLE, RAIL, bicycle
from tests.tiers import slow_but

pytestmark = pytest.mark.usefixtures("elsewhere")

TRUNK = """
<mujoco>
  {head}
  <option timestep="0.002" integrator="RK4" {option}/>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>
    <body name="trunk" pos="0 0 0.1"><joint name="hip" axis="0 1 0"/>
      <geom type="box" size="0.1 0.1 0.2" pos="0 0 0.25" mass="5" contype="0" conaffinity="0"/>
      <body {name} pos="0 0 0.6">{joint}
        <geom type="sphere" size="0.08" pos="0 0 0.1" mass="3" contype="0" conaffinity="0"/></body>
      {more}
    </body>
  </worldbody>
  {after}
</mujoco>
"""
NECK = '<joint name="neck" axis="0 1 0"/>'
TENDON = '<tendon><fixed name="t"><joint joint="neck" coef="1"/></fixed></tendon>'
EQUAL = "<equality>{}</equality>"
BENT_KEYFRAME = '<keyframe><key name="bent" qpos="0 0.3"/></keyframe>'
UPRIGHT = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>{before}
    <body name="t" pos="0.3 0 0.5" {turned}>
      <joint name="rx" type="slide" axis="1 0 0"/><joint name="rz" type="slide" axis="0 0 1"/>
      <joint name="ry" axis="0 1 0"/>
      <geom type="box" size="0.05 0.05 0.3" mass="6"/>
      <geom type="capsule" size="0.02 0.2" euler="1.5708 0 0" pos="0 0 -0.32" mass="0.5"/>{more}
    </body>{after}
  </worldbody>
</mujoco>
"""


def trunk(**changes: str) -> mujoco.MjSpec:
    fields = {"head": "", "option": "", "name": 'name="head"', "joint": "", "more": "", "after": ""} | changes
    return mujoco.MjSpec.from_string(TRUNK.format(**fields))


def mount_head(**options: Any) -> MountedRobot:
    changes = {name: options.pop(name) for name in list(options) if name in TRUNK and isinstance(options[name], str)}
    return mount(trunk(**changes), **{"body": "trunk", "axis": "hip", "position": (0.0, 0.0, 0.5), **options})


def rig(**options: Any) -> Plant:
    return load_plant(model=str(mount_head(**options).save("rig.xml")))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Plant:
    """The head fixed to the trunk."""
    return load_plant(model=str(mount_head().save(tmp_path_factory.mktemp("plain") / "plain.xml")))


def same(result: Plant, expected: Plant) -> None:
    for name in ("J1", "J_d", "gravity_torque"):
        assert getattr(result.reduced, name) == pytest.approx(getattr(expected.reduced, name), rel=1e-4), name


@pytest.mark.daily_cases("dense-named", "sparse-unnamed")
@pytest.mark.parametrize("name", ['name="head"', ""], ids=["named", "unnamed"])
@pytest.mark.parametrize("option", ["", 'jacobian="sparse"'], ids=["dense", "sparse"])
def test_a_ball_that_is_held_is_rigid(plain: Plant, name: str, option: str) -> None:
    """The weld that holds it holds its inertia too, and is one with its own trunk, not with the world."""
    result = rig(name=name, joint='<joint type="ball"/>', option=option)
    same(result, plain)
    pole = math.sqrt(result.reduced.gravity_torque / result.reduced.J1)
    assert simulated_pole(result.model, result.key, result.axis.line, result.axis.bias) == pytest.approx(pole, rel=0.01)
    assert 0 not in (int(result.model.eq_obj1id[0]), int(result.model.eq_obj2id[0]))


def test_a_ball_is_held_by_an_earlier_mount() -> None:
    """A closed chain is refused; the weld of an earlier mount is none, and stays."""
    result = mount(
        mujoco.MjSpec.from_string(
            '<mujoco><worldbody><body name="cross" pos="0 0 0.1"><joint name="roll" axis="1 0 0"/>'
            '<inertial pos="0 0 0" mass="0.05" diaginertia="1e-5 1e-5 1e-5"/><body name="trunk">'
            '<joint name="pitch" axis="0 1 0"/><geom type="box" size="0.05 0.05 0.1" pos="0 0 0.2" mass="2"/>'
            '<body pos="0 0 0.5"><joint type="ball"/><geom size="0.02" mass="0.1"/></body></body></body></worldbody>'
            "</mujoco>"
        ),
        "trunk",
        axis="roll",
        name="roll",
        position=(0.0, 0.0, 0.15),
    )
    assert result.held == ("pitch", "body3_joint")
    twice = mount(result.spec, "trunk", axis="pitch", name="pitch", position=(0.0, 0.0, 0.35))
    assert [equality.name for equality in twice.spec.equalities] == ["body3_joint_held"]
    with pytest.raises(InputError, match="the hinge 'pitch' has an axis already: another one needs another hinge"):
        mount(twice.spec, "trunk", axis="pitch", name="third", position=(0.0, 0.0, 0.55))


@pytest.mark.parametrize(
    "head",
    [
        '<compiler boundinertia="0.005"/>',
        '<compiler boundmass="0.7"/>',
        '<compiler boundmass="0.001" boundinertia="0.001"/>',
        '<compiler discardvisual="true"/>',
        '<compiler fusestatic="true"/>',
        '<default><site euler="10 0 0"/></default>',
        '<default><equality active="false"/></default>',
    ],
)
def test_a_compilers_setting_leaves_modules_as_they_are(plain: Plant, head: str) -> None:
    result = rig(head=head, joint=NECK)
    same(result, plain)
    for body in ("gimbal", "flywheel", "half"):
        for field in ("body_mass", "body_inertia"):
            actual, expected = (
                getattr(plant.model, field)[plant.model.body(f"cube1/{body}").id] for plant in (result, plain)
            )
            np.testing.assert_allclose(actual, expected, rtol=1e-4)


@pytest.mark.parametrize(
    ("equality", "held_joints"),
    [
        ('<joint name="neck_held" joint1="neck" active="false"/>', ("neck",)),
        ('<joint name="neck_held" joint1="neck" joint2="hip" active="false"/>', ("neck",)),
        ('<joint name="mine" joint1="neck"/>', ()),
    ],
)
def test_a_joint_is_held_already_by_what_holds_it(plain: Plant, equality: str, held_joints: tuple[str, ...]) -> None:
    """Not by a name; nor do names collide."""
    result = mount_head(joint=NECK, after=f"<equality>{equality}</equality>")
    assert result.held == held_joints
    same(load_plant(model=str(result.save("rig.xml"))), plain)


@pytest.mark.parametrize("hold", slow_but(["servos", "constraints"], "servos"))
@pytest.mark.parametrize(
    ("servo", "setpoint", "state"),
    [
        ('<position name="s" joint="neck" kp="2000" kv="20"/>', 0.3, None),
        ('<position name="s" joint="neck" kp="2000" kv="20" gear="2"/>', 0.6, None),
        ('<position name="s" joint="neck" kp="2000" kv="20" timeconst="0.1"/>', 0.3, 0.3),
        ('<intvelocity name="s" joint="neck" kp="2000" kv="20" actrange="-3 3"/>', 0.0, 0.3),
        ('<general name="s" joint="neck" biastype="affine" gainprm="1000" biasprm="20 -2000 -20"/>', 0.58, None),
    ],
)
def test_a_servo_gets_the_setpoint_that_holds_it_where_it_stands(
    servo: str, setpoint: float, state: float | None, hold: str
) -> None:
    """It exerts no force there; what it is told is not its joint's position, with a gear or an offset."""
    actuators = f"<actuator>{servo}</actuator>{BENT_KEYFRAME}"
    result = mount_head(joint=NECK, after=actuators, keyframe="bent", hold=hold)
    assert result.held == (() if hold == "servos" else ("neck",))
    plant = load_plant(model=str(result.save("rig.xml")))
    data = mujoco.MjData(plant.model)
    mujoco.mj_resetDataKeyframe(plant.model, data, plant.key)
    mujoco.mj_forward(plant.model, data)
    servo_id = plant.model.actuator("s").id
    assert data.qpos[plant.model.joint("neck").qposadr[0]] == pytest.approx(0.3)
    assert data.actuator_force[servo_id] == pytest.approx(0.0, abs=1e-2)
    assert data.ctrl[servo_id] == pytest.approx(setpoint, abs=1e-5)
    if state is not None:
        assert data.act[plant.model.actuator_actadr[servo_id]] == pytest.approx(state, abs=1e-5)
    pole = math.sqrt(plant.reduced.gravity_torque / plant.reduced.J1)
    assert simulated_pole(plant.model, plant.key, plant.axis.line, plant.axis.bias) == pytest.approx(pole, rel=0.02)


@pytest.mark.parametrize("drive", ["motor", "velocity"])
def test_what_only_drives_a_joint_does_not_hold_it(drive: str) -> None:
    actuators = f'<actuator><{drive} name="s" joint="neck"/></actuator>'
    assert mount_head(joint=NECK, after=actuators, hold="servos").held == ("neck",)


@pytest.mark.parametrize(
    ("changes", "options", "message"),
    [
        (
            {"joint": NECK, "after": '<equality><joint name="e" joint1="neck" polycoef="0.2 0 0 0 0"/></equality>'},
            {},
            "equality 'e' of 'neck' is off by 0.2 where the robot is to stand: give a --keyframe",
        ),
        (
            {"joint": NECK, "after": TENDON + EQUAL.format('<tendon name="e" tendon1="t" polycoef="-0.3 0 0 0 0"/>')},
            {},
            "equality 'e' of 't' is off by 0.3 where",
        ),
        (
            {
                "joint": NECK + '<joint name="nod" axis="1 0 0"/>',
                "after": EQUAL.format('<joint name="e" joint1="neck" joint2="nod" polycoef="0.1 1 0 0 0"/>'),
            },
            {},
            "equality 'e' of 'neck' is off by 0.1 where",
        ),
        (
            {"after": '<equality><joint name="e" joint1="hip"/></equality>'},
            {},
            "falls too slowly from a tilt of 0.05 deg, with 0 1/s; .*: an equality of the joint holds it",
        ),
        ({"option": 'gravity="0 0 9.81"'}, {}, 'gravity="0 0 9.81"/>: pulls 180 deg off straight down'),
        ({"option": 'gravity="0 0 0"'}, {}, 'gravity="0 0 0"/>: pulls 180 deg off straight down'),
        ({"option": 'gravity="0.5 0 -9.8"'}, {}, 'gravity="0.5 0 -9.8"/>: pulls 2.92 deg off straight down'),
    ],
)
def test_refused_in_one_line(changes: dict[str, str], options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as info:
        mount_head(**changes, **options)
    assert "\n" not in str(info.value)


@pytest.mark.parametrize(
    ("frame", "rotation"),
    [
        ('pos="1 0 0.5" euler="0 0 0.7"', ""),
        ('pos="1 0 0.5" euler="0 0 0.7"', 'euler="0 0 0.5"'),
        ('pos="1 0 0.5" euler="0.5 0 0"', 'euler="-0.5 0 0"'),
    ],
)
def test_a_free_base_within_a_frame_stands_where_it_stood(frame: str, rotation: str) -> None:
    """Over the same place of the floor, turned the same way; the frame counts once."""
    text = UPRIGHT.format(before=f"<frame {frame}>", turned=rotation, more="", after="</frame>")
    reference = mujoco.MjModel.from_xml_string(text)
    before = mujoco.MjData(reference)
    mujoco.mj_forward(reference, before)
    result = mount(mujoco.MjSpec.from_string(text), "t", base="free", position=(0.0, 0.0, 0.1))
    assert not [note for note in result.notes if "keyframes" in note]
    model = result.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("equilibrium").id)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.body("t").xpos[:2], before.body("t").xpos[:2], atol=1e-4)
    np.testing.assert_allclose(data.body("t").xmat, before.body("t").xmat, atol=1e-4)


def test_a_free_base_says_that_keyframes_are_left_out() -> None:
    """Their joints are gone."""
    text = UPRIGHT.format(before="", turned="", more="", after="")
    text = text.replace("</mujoco>", '<keyframe><key name="home" qpos="0 0 0"/></keyframe></mujoco>')
    result = mount(mujoco.MjSpec.from_string(text), "t", base="free", position=(0.0, 0.0, 0.1))
    assert "its keyframes are left out: they have the joints that a free base replaces" in result.notes


FLAT = 0.01, 0.003
"""Half of the width of flat tyres [m]."""


@pytest.mark.daily_cases("0.01-0.003-0.15", "0.003-0.003-0.0")
@pytest.mark.parametrize("ahead", [0.0, 0.15])
@pytest.mark.parametrize("beside", [0.0, 0.003])
@pytest.mark.parametrize("half_width", FLAT)
def test_flat_tyres_are_as_wide_as_they_are(half_width: float, beside: float, ahead: float) -> None:
    """The line goes along them, not through opposite corners, and under the mass."""
    spec = mujoco.MjSpec.from_string(bicycle(half_width, ahead=ahead, beside=beside))
    model = mount(spec, "frame", axis="x", position=(0.0, 0.0, 0.4)).spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("equilibrium").id)
    mujoco.mj_forward(model, data)
    along = data.site("tilt").xmat.reshape(3, 3)[:, 1]
    wheels = data.xpos[[body for body in range(model.nbody) if model.body(body).name.startswith("body")]]
    apart = wheels.max(axis=0) - wheels.min(axis=0)
    assert math.degrees(math.acos(abs(float(along @ apart)) / float(np.linalg.norm(apart)))) < 0.1


@pytest.mark.parametrize("tyre", ['margin="0.02" solref="0.004 1" solimp="0.99 0.999 0.001"', 'margin="0.001"'])
def test_stiff_contacts_with_a_margin_do_not_throw_a_robot(tyre: str) -> None:
    """It stands where its contacts bear it: a margin above the floor."""
    spec = mujoco.MjSpec.from_string(bicycle(0.003, tyre, ahead=0.17, mass=13.0, start=0.44))
    model = mount(spec, "frame", axis="x", position=(0.0, 0.0, 0.4)).spec.compile()
    height = float(model.key("equilibrium").qpos[2])
    assert height == pytest.approx(0.34 + float(model.geom_margin.max()), abs=2e-3)


def test_a_cart_that_its_rail_overlaps_is_told_so() -> None:
    """Released, the contact with the rail holds the cart; held, the pole falls as if there were no rail."""
    spec = mujoco.MjSpec.from_string(CART_POLE.format(rails=RAIL))
    with pytest.raises(InputError, match=r"falls too slowly from a tilt .* geoms that overlap hold it"):
        mount(spec, "pole", axis="hinge", release=["slider"])
    mount(mujoco.MjSpec.from_string(CART_POLE.format(rails="")), "pole", axis="hinge", release=["slider"])
