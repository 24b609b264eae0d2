"""How a robot comes to stand: of any size, on whatever it touches, and not where it stands by itself."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting import mount
from cmg_mj.features.mounting.report import _advice
from cmg_mj.features.mounting.robot import set_physics_options
from cmg_mj.plant.axis import find_axis
from cmg_mj.plant.elements import axis_modules
from cmg_mj.plant.plant import load_plant
from cmg_mj.plant.settings import FLAGS_OFF
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj
from tests.features.mounting.sizes import LENGTHS, robot
from tests.tiers import slow_but

pytestmark = pytest.mark.usefixtures("elsewhere")

TRUNK = """
<mujoco>
  <option timestep="0.002"/>{before}
  <worldbody>{floor}
    <body name="trunk" pos="0 0 {z}" {trunk}><freejoint name="root"/>
      <geom type="box" size="0.1 0.1 0.2" pos="0 0 0.25" mass="6"/>{feet}
    </body>{more}
  </worldbody>{after}
</mujoco>
"""
FLOOR = '<geom name="floor" type="plane" size="5 5 0.1"/>'
FEET = "".join(
    f'<geom name="{name}" size="0.03" pos="0 {y} -0.4" mass="0.2"/>' for name, y in (("l", 0.2), ("r", -0.2))
)
CENTRE = '<geom {} pos="0 0 -0.2" mass="0.4"/>'
BALL = '<body name="ball" pos="0 0 0.2"><freejoint name="b"/><geom size="0.2" mass="5"/></body>'
CART = '<body name="cart" pos="0 0 0.2"><joint type="slide"/><geom type="box" size="1 1 0.2" mass="5"/></body>'


def soles(turned: str, x: float = 0.0, lower: float = 0.0) -> str:
    """Two flat feet of 12 cm, turned [deg], ahead, the right one lower."""
    places = ((0.1, -0.4), (-0.1, -0.4 - lower))
    box = '<geom type="box" size="0.06 0.03 0.01" pos="{} {} {}" euler="{}" mass="0.3"/>'
    return "".join(box.format(x, y, z, turned) for y, z in places)


def trunk(**changes: Any) -> str:
    fields = {"before": "", "floor": FLOOR, "z": 0.43, "trunk": "", "feet": FEET, "more": "", "after": ""}
    return TRUNK.format(**(fields | changes))


def put(text: str, **options: Any) -> mujoco.MjModel:
    return mount(
        mujoco.MjSpec.from_string(text), **{"body": "trunk", "axis": "y", "scale": 1.2, **options}
    ).spec.compile()


@pytest.fixture(scope="module")
def plain() -> np.ndarray:
    return put(trunk()).key("equilibrium").qpos


def rolling_pole(model: mujoco.MjModel, radius: float) -> float:
    """The rate at which a rigid body on balls of this radius falls, by the energy of a roll, [1/s]."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("equilibrium").id)
    mujoco.mj_forward(model, data)
    mass = model.body_mass[1:]
    height = mass @ data.xipos[1:, 2] / mass.sum()
    centre = mass @ data.xipos[1:] / mass.sum()
    inertia = 0.0
    for body in range(1, model.nbody):
        turn, arm = data.ximat[body].reshape(3, 3), (data.xipos[body] - centre)[[0, 2]]
        inertia += turn[1] @ (model.body_inertia[body] * turn[1]) + model.body_mass[body] * arm @ arm
    return math.sqrt(mass.sum() * 9.81 * (height - radius) / (inertia + mass.sum() * height**2))


def simulated_rate(model: mujoco.MjModel, expected: float) -> float:
    """The same in plain MuJoCo, wheels at rest: half the difference of the leans to either side grows as cosh."""
    key, ends, start = model.key("equilibrium").id, [], 1e-3
    line = find_axis(model, key, "", axis_modules(model)[""]).line
    for tilt in (start, -start):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, key)
        data.qvel[:], data.ctrl[:] = 0.0, 0.0
        line.tilt(data, tilt)
        while data.time < 2.5 / expected:
            mujoco.mj_step(model, data)
        ends.append(line.lean(data.qpos))
    return math.acosh((ends[0] - ends[1]) / (2.0 * start)) / data.time


@pytest.mark.parametrize("step", [0.0005, 0.002, 0.005])
@pytest.mark.parametrize("size", slow_but([0.05, 0.1, 0.25, 1.0, 3.0], 0.05, 3.0))
def test_a_robot_of_any_size_stands_and_falls_at_any_step(size: float, step: float) -> None:
    """With the masses of one material, and with 2 kg, at the rate of a closed form."""
    for density in (263.0, 2.0 / size**3):
        model = put(
            robot("ball feet", size, step, density), body="frame", scale=4.0 * size, position=(0.0, 0.0, 0.7 * size)
        )
        expected = rolling_pole(model, LENGTHS["r"] * size)
        assert simulated_rate(model, expected) == pytest.approx(expected, rel=0.01)  # soft contacts give way
        if density == 263.0:
            assert expected * math.sqrt(size) == pytest.approx(2.686, rel=1e-3)


@pytest.mark.parametrize("step", [0.0005, 0.005])
@pytest.mark.parametrize("size", [0.05, 1.0])
def test_a_mass_on_a_mast_settles(size: float, step: float) -> None:
    """The inertia about its own centre is a five-thousandth of that about the line."""
    text = robot("ball feet", size, step).replace('type="box" size="', f'size="{0.03 * size}" user="')
    model = put(text, body="frame", scale=max(0.3 * size, 0.05), position=(0.0, 0.0, 0.5 * size))
    expected = rolling_pole(model, LENGTHS["r"] * size)
    assert simulated_rate(model, expected) == pytest.approx(expected, rel=0.02)


HFIELD = '<asset><hfield name="h" nrow="9" ncol="9" size="2 2 0.1 0.1"/></asset>'
UNTOUCHED = trunk(floor=FLOOR.replace("/>", ' contype="0" conaffinity="0"/>'), after="{}").replace(
    'mass="0.2"', 'mass="0.2" contype="0" conaffinity="0"'
)
TIED = '<body name="box" pos="1 0 0.3"><freejoint name="box"/><geom size="0.1"/></body>'


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (trunk(z=2.0), {}),
        (trunk(z=0.0), {}),
        (
            UNTOUCHED.format(
                "<contact>{}</contact>".format("".join(f'<pair geom1="{f}" geom2="floor"/>' for f in "lr"))
            ),
            {},
        ),
        (trunk(before=HFIELD, floor='<geom type="hfield" hfield="h" pos="0 0 -3"/>'), {}),
        (trunk(after='<equality><connect body1="trunk" anchor="0 0 0" active="false"/></equality>'), {}),
        (
            trunk(more=TIED, after='<equality><weld body1="trunk" body2="box" active="false"/></equality>'),
            {"release": ["box"]},
        ),
        (trunk(feet=FEET + '<geom size="0.03" pos="0.37 0 -0.3" mass="0"/>'), {}),
    ],
    ids=["above", "below", "pair", "height field", "inactive connect", "inactive weld", "a bumper at 15 deg"],
)
def test_a_robot_stands_on_what_it_touches(plain: np.ndarray, text: str, options: dict[str, Any]) -> None:
    """As the plain one does, whose floor is at 0; that of the height field is at -3."""
    pose = put(text, **options).key("equilibrium").qpos
    np.testing.assert_allclose(pose[3:7], plain[3:7], atol=2e-3)
    assert pose[2] + 3.0 * ("hfield" in text) == pytest.approx(plain[2], abs=2e-3)


POINT = "stands on a point: its support is .* m long along the axis, and it would fall sideways too"
BY_ITSELF = "stands by itself: its support is .* m wide across the axis"
NEAR = "stands by itself: let go where its mass is above the line, it is still within 10 deg of there"
SLIDES = "stands on contacts with a friction of .*, and would slide: give them 0.035 or more"
MOVES = "rests on the body '{}', which moves: let the two not collide"


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (trunk(feet=CENTRE.format('size="0.03"')), {}, POINT),
        (trunk(feet=CENTRE.format('type="capsule" size="0.02 0.2"')), {}, POINT),
        (trunk(feet=CENTRE.format('type="cylinder" size="0.01 0.2"')), {}, POINT),
        (trunk(feet=FEET.replace("0.2 -0.4", "0.012 -0.4")), {}, POINT),
        *((trunk(z=0.5, feet=soles(turned)), {}, BY_ITSELF) for turned in ("0 1.5 0", "0 -3 0", "3 0 0", "3 3 0")),
        (trunk(z=0.5, feet=soles("0 0 0", lower=0.01)), {}, BY_ITSELF),
        (trunk(z=0.5, feet=soles("0 2 0", x=-0.08)), {}, NEAR),
        (trunk(feet=FEET + '<geom size="0.03" pos="0.229 0 -0.38" mass="0"/>'), {}, NEAR),
        (trunk(before='<default><geom condim="1"/></default>'), {}, SLIDES),
        (trunk(before='<default><geom friction="0 0 0"/></default>'), {}, SLIDES),
        (trunk(before='<default><geom friction="0.02 0 0"/></default>'), {}, SLIDES),
        (
            trunk(
                z=0.83,
                feet=FEET.replace("0.2 -", "0.05 -"),
                more=BALL,
            ),
            {"release": ["b"]},
            MOVES.format("ball"),
        ),
        (trunk(z=0.9, more=CART), {}, MOVES.format("cart")),
        (trunk(trunk='gravcomp="1"'), {}, "body 'trunk' has gravcomp = 1: .*; take gravcomp out of the file"),
        (
            trunk(feet=FEET + '<body name="arm" gravcomp="0.5"><geom size="0.05"/></body>'),
            {},
            "body 'arm' has gravcomp = 0.5",
        ),
        (
            trunk(feet='<body name="link"><geom size="0.1" mass="2"/></body>').replace('mass="6"', 'mass="0"'),
            {},
            "--body trunk: has no mass of its own; the bodies with mass on it: link",
        ),
        (
            trunk().replace("<option", '<option density="1000"'),
            {},
            "<option density=1000 viscosity=0>: the fluid brakes",
        ),
        (
            trunk(before='<default><geom condim="6" friction="1 1 1"/></default>'),
            {},
            r"falls too slowly .*: rolling friction \(condim 6\) holds it",
        ),
        (trunk(after='<contact><exclude body1="world" body2="trunk"/></contact>'), {}, "conaffinity, <exclude>"),
        (trunk(), {"body": "base"}, "--body base: no such body"),
        (
            trunk(more='<geom size="0.1" pos="3 0 0"/>'),
            {"body": "base"},
            'no such body; .* root of a URDF a part of the world: save it with <compiler fusestatic="false"/>',
        ),
    ],
)
def test_refused_by_the_true_reason(text: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as info:
        put(text, **options)
    assert "\n" not in str(info.value)


PUSHED = "above the line a spring or an actuator pushes the robot by {} N m, as much as gravity at"
HELD = "falls too slowly from .*: {} holds it; take that out of the file"
HINGED = """
<mujoco><option timestep="0.002"/><worldbody>{more}
  <body name="trunk" pos="0 0 1"><joint name="h" axis="0 1 0" {joint}/>
    <geom type="box" size=".05 .05 .2" pos="{x} 0 .2" mass="5"/><site name="top" pos="0 0 0.4"/>
  </body></worldbody>{after}
</mujoco>
"""
SERVO = '<actuator><position joint="h" kp="100"/></actuator>'
GUY = '<tendon><spatial stiffness="2e3"><site site="top"/><site site="{}"/></spatial></tendon>'


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"joint": 'stiffness="15" springref="20"'}, PUSHED.format("5.24")),
        ({"joint": 'stiffness="3" springref="-60"'}, PUSHED.format("-3.14")),
        ({"joint": 'stiffness="10"', "x": 0.08}, PUSHED.format("3.81")),
        (
            {"after": '<actuator><general joint="h" biastype="affine" biasprm="4 0 0"/></actuator>'},
            PUSHED.format(4),
        ),
        ({"joint": 'stiffness="60"'}, HELD.format("the joint's spring")),
        ({"joint": 'frictionloss="0.5"'}, HELD.format("the joint's frictionloss")),
        ({"after": SERVO}, HELD.format("an actuator of the joint")),
        ({"more": '<site name="at" pos="1 0 1.4"/>', "after": GUY.format("at")}, HELD.format("a tendon")),
        ({"joint": 'stiffness="15"', "after": '<actuator><motor joint="h"/></actuator>'}, ""),
    ],
)
def test_what_pushes_or_holds_a_hinge_is_named(fields: dict[str, Any], message: str) -> None:
    """By hand: the torque of a spring is k (springref - q), of 20 deg, or of q = -atan(0.08/0.2)."""
    text = HINGED.format(**({"joint": "", "x": 0, "more": "", "after": ""} | fields))
    if not message:
        put(text, scale=1.0)
        return
    with pytest.raises(InputError, match=message):
        put(text, scale=1.0)


@pytest.mark.parametrize(
    ("limits", "refused"),
    [
        ('range="-180 180"', True),
        ('range="0 180"', True),
        ('range="-181 90"', True),
        ('range="0 190" margin="0.2"', True),
        ('range="-90 90"', True),
        ('range="0 190"', False),
        ("", False),
    ],
)
def test_a_range_must_leave_room_to_lean(limits: str, refused: bool) -> None:
    text = (
        f'<mujoco><worldbody><body name="arm" pos="0 0 1"><joint name="swing" axis="0 1 0" {limits}/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" mass="0.5"/></body></worldbody>'
        '<keyframe><key name="up" qpos="3.14159"/></keyframe></mujoco>'
    )
    for keyframe in ("up", None):
        options = {"body": "arm", "axis": "swing", "scale": 0.6, "keyframe": keyframe}
        if refused:
            with pytest.raises(InputError, match=r"would stand upright at -?3.142 rad, at the end of its range of"):
                put(text, **options)
        else:
            put(text, **options)


def test_a_keyframe_is_kept_whole() -> None:
    """Only the pair's joints and controls are added: names, times, rates, states and mocap poses stay."""
    arm = '<body name="arm" pos="0 0 0.5"><joint name="arm" axis="0 1 0"/><geom size="0.02" mass="0.8"/></body>'
    key = '<key name="{}" time="2" qpos="0 0 0.43 1 0 0 0 0.5" qvel="0.1 0 0 0 0 0 0.7" ctrl="2.1 3" act="0.4" {}/>'
    keys = key.format("home", 'mpos="1 0.5 2" mquat="0 1 0 0"') + key.format("", 'mpos="1 1 1" mquat="1 0 0 0"')
    motors = '<motor name="m" joint="arm"/><general joint="arm" dyntype="integrator"/>'
    text = trunk(
        feet=FEET + arm,
        more='<body name="target" mocap="true" pos="1 0 1"/>',
        after=f"<actuator>{motors}</actuator><keyframe>{keys}</keyframe>",
    )
    own, model = mujoco.MjModel.from_xml_string(text), put(text, keyframe="home")
    assert [model.key(i).name for i in range(model.nkey)] == ["equilibrium", "home", ""]
    for i in range(own.nkey):
        before, after = own.key(i), model.key(i + 1)
        for field, count in {"time": 1, "qpos": 8, "qvel": 7, "ctrl": 2, "act": 1, "mpos": 3, "mquat": 4}.items():
            np.testing.assert_allclose(getattr(after, field)[:count], getattr(before, field), atol=1e-9, err_msg=field)
        assert sorted(np.abs(after.ctrl[2:])) == pytest.approx([0.0, 0.0, 314.0, 314.0])
        assert after.act[1:] == pytest.approx(math.pi / 2.0)


@pytest.mark.parametrize(
    ("option", "flags"),
    [
        ('actuatorgroupdisable="0 3"', ""),
        ('density="1.2" wind="5 0 0"', ""),
        ("", "sleep='enable'"),
        ('integrator="discrete" solver="CG"', "ipc='enable'"),
        ("", "fwdinv='enable' invdiscrete='enable'"),
    ],
)
def test_the_pair_works_whatever_the_file_switches(option: str, flags: str) -> None:
    """Groups of actuators that are off, wind, and flags that RK4 or many worlds at once do not know."""
    text = trunk().replace('timestep="0.002"/', f'timestep="0.002" {option}><flag {flags}/></option')
    Path("robot.xml").write_text(text, encoding="utf-8")
    command = ("mount", "robot.xml", "--body", "trunk", "--scale", "1.2", "-o", "pair.xml", "--quick")
    assert cmg_mj(*command).status == 0
    stood = prepare(load_scenario("pair.toml", ["push=[]", "duration_s=3"])).run_many(2, keep_trajectory=False).stood
    assert stood.all()
    assert not load_plant(model="pair.xml").model.opt.enableflags & FLAGS_OFF


def test_flags_of_a_file_by_hand_are_off_in_every_run() -> None:
    mount(mujoco.MjSpec.from_string(trunk()), "trunk", scale=1.2).save("pair.xml")
    text = Path("pair.xml").read_text(encoding="utf-8")
    start = text.index("<option")
    end = text.index("/>", start)
    Path("asleep.xml").write_text(f"{text[:end]}><flag sleep='enable'/></option>{text[end + 2 :]}", encoding="utf-8")
    assert mujoco.MjModel.from_xml_path("asleep.xml").opt.enableflags
    assert not load_plant(model="asleep.xml").model.opt.enableflags


def test_small_steps_are_named_before_the_trials_and_where_the_search_does_not_end(
    caplog: pytest.LogCaptureFixture,
) -> None:
    for step in ("0.002", "0.000025"):
        set_physics_options(mujoco.MjSpec.from_string(trunk().replace("0.002", step)))
    assert [message[:34] for message in caplog.messages] == ["hint: <option timestep> = 2.5e-05:"]
    small, usual = (_advice(SimpleNamespace(plant=SimpleNamespace(timestep=step))) for step in (25e-6, 1e-3))  # type: ignore[arg-type]
    assert "its physics steps of 0.025 ms are too many; give its file a larger <option timestep>" in small
    assert "while the machine does nothing else" in usual
