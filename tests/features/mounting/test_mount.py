"""The result of mount: the file is the spec, joints are held, and the line on the floor tilts like a hinge."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting import mount
from cmg_mj.features.mounting.limits import push_limits
from cmg_mj.features.mounting.write import write_scenario
from cmg_mj.plant.axis import find_axis
from cmg_mj.plant.elements import axis_modules
from cmg_mj.plant.plant import load_plant
from cmg_mj.plant.tilt_line import SupportLine
from cmg_mj.runs.experiment import prepare
from tests.command import cmg_mj
from tests.features.mounting.push_robots import without_time_limit
from tests.features.mounting.robots import EXAMPLES, ROBOTS
from tests.recorded import recorded

pytestmark = pytest.mark.usefixtures("elsewhere")

BALL = """
<mujoco>
  <option timestep="0.001" integrator="RK4"/>
  <worldbody>
    <body name="pole" pos="0 0 0.5">
      <joint name="ankle" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.8" size="0.03" mass="2"/>
      <body name="arm" pos="0 0 0.6" euler="20 10 0">
        <joint name="shoulder" type="ball"/>
        <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="0.2"/>
        <body name="slide" pos="0.2 0 0"><joint name="gripper" type="slide" axis="1 0 0"/>
          <geom size="0.02" mass="0.1"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
UNIVERSAL = """
<mujoco>
  <option timestep="0.001" integrator="RK4"/>
  <worldbody>
    <body name="cross" pos="0 0 0.1"><joint name="roll" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="0.05" diaginertia="1e-5 1e-5 1e-5"/>
      <body name="trunk"><joint name="pitch" axis="0 1 0"/>
        <geom type="box" size="0.05 0.05 0.1" pos="{0} 0 0.2" mass="2"/></body></body>
  </worldbody>
</mujoco>
"""


def everything(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    names = [name for name in dir(model) if "_" in name and not name.startswith("_")]
    return {name: values for name in names if isinstance(values := getattr(model, name), np.ndarray)}


@pytest.mark.daily_cases("bicycle", "humanoid")
@pytest.mark.parametrize("name", ["bicycle", "walker2d, freed", "humanoid"])
def test_the_file_is_the_spec(name: str) -> None:
    """MuJoCo writes six digits."""
    result = mount(ROBOTS[name].path, **ROBOTS[name].options)
    file_model, spec_model = mujoco.MjModel.from_xml_path(str(result.save("rig.xml"))), result.spec.compile()
    file_arrays, spec_arrays = everything(file_model), everything(spec_model)
    for field in ("body_mass", "body_inertia", "body_pos", "jnt_axis", "eq_solimp", "site_pos"):
        np.testing.assert_allclose(file_arrays[field], spec_arrays[field], rtol=1e-4, atol=1e-5, err_msg=field)
    for field in ("qpos", "qvel", "act", "ctrl"):
        actual, expected = (getattr(model.key("equilibrium"), field) for model in (file_model, spec_model))
        np.testing.assert_allclose(actual, expected, rtol=1e-4, atol=1e-5, err_msg=field)
    np.testing.assert_allclose(file_arrays["eq_data"][:, :5], spec_arrays["eq_data"][:, :5], atol=1e-5)
    assert {k: v.shape for k, v in file_arrays.items()} == {k: v.shape for k, v in spec_arrays.items()}


def test_a_spec_is_taken_and_not_changed() -> None:
    spec = mujoco.MjSpec.from_string(BALL)
    before = spec.to_xml()
    result = mount(spec, "pole")
    assert spec.to_xml() == before
    assert result.spec.body("cube1/half") is not None


@pytest.mark.slow
def test_every_joint_is_held_where_it_stands() -> None:
    """A ball, too, and in any pose of its reference: a run with pushes moves them by less than 0.1 deg."""
    mounting = mount(mujoco.MjSpec.from_string(BALL), "pole")
    assert mounting.held == ("shoulder", "gripper")
    model = mounting.save("rig.xml")
    outlook = push_limits(write_scenario(model, model, "homogeneous"))
    assert not outlook.hints
    result = write_scenario(model, model, "homogeneous", outlook).run()
    assert result.stood.all()
    trajectory = recorded(result)
    quaternions = np.stack([trajectory[f"orientation/shoulder/{part}"] for part in "xyz"])
    assert np.degrees(2.0 * np.abs(quaternions)).max() < 0.1
    assert np.abs(trajectory["position/gripper_m"]).max() < 1e-3


def test_servos_hold_what_they_drive() -> None:
    text = BALL.replace("</mujoco>", '<actuator><position joint="gripper" kp="2000" kv="20"/></actuator></mujoco>')
    assert mount(mujoco.MjSpec.from_string(text), "pole", hold="servos").held == ("shoulder",)
    assert mount(mujoco.MjSpec.from_string(text), "pole", release=["gripper"]).held == ("shoulder",)


def test_a_larger_module_has_more_momentum() -> None:
    """Masses grow with s^3, inertias and with them the momentum with s^5; the wheels turn as fast."""
    models = [
        load_plant(model=str(mount(EXAMPLES / "torso.xml", "torso", axis="x", scale=s).save(f"{s}.xml")))
        for s in (1.0, 1.5)
    ]
    small, large = (plant.reduced for plant in models)
    assert large.J_d / small.J_d == pytest.approx(1.5**5, rel=1e-4)
    assert large.omega_d == pytest.approx(small.omega_d)
    masses = [plant.model.body("cube1/flywheel").mass[0] for plant in models]
    assert masses[1] / masses[0] == pytest.approx(1.5**3, rel=1e-4)


def test_the_line_on_the_floor_is_a_hinge_in_its_place() -> None:
    """The bicycle with a hinge along the line that mount has found, for its free joint: the same reduced model."""
    result = mount(ROBOTS["bicycle"].path, **ROBOTS["bicycle"].options)
    model = result.spec.compile()
    key = model.key("equilibrium").id
    free = find_axis(model, key, "", axis_modules(model)[""])
    assert isinstance(free.line, SupportLine)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    qpos, qvel, spec = data.qpos.copy(), data.qvel.copy(), result.spec
    frame = spec.body("frame")
    spec.delete(spec.joint("root"))
    frame.pos, frame.quat = qpos[:3], qpos[3:7]
    frame.add_joint(name="roll", type=mujoco.mjtJoint.mjJNT_HINGE, pos=free.point, axis=free.direction)
    spec.key("equilibrium").qpos, spec.key("equilibrium").qvel = [0.0, *qpos[7:]], [0.0, *qvel[6:]]
    hinged = spec.compile()
    hinge_axis = find_axis(hinged, hinged.key("equilibrium").id, "", axis_modules(hinged)[""])
    for name in ("J1", "J2", "J_d", "omega_d", "gravity_torque"):
        expected = getattr(hinge_axis.reduced, name)
        assert getattr(free.reduced, name) == pytest.approx(expected, rel=1e-5, abs=1e-6 * hinge_axis.reduced.J1), name


@pytest.mark.daily_cases("link", "robot", "sibling")
@pytest.mark.parametrize("folder", ["robot", "sibling", ".", "far/away/from/it", "link"])
def test_meshes_are_found_from_any_folder(tmp_path: Path, folder: str) -> None:
    """By paths that stay right when all is moved, but behind a symbolic link, where no relative one is."""
    (tmp_path / "robot" / "meshes").mkdir(parents=True)
    points = "\n".join(f"v {x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (0, 8))
    faces = "f 1 3 4\nf 1 4 2\nf 5 6 8\nf 5 8 7\nf 1 2 6\nf 1 6 5\nf 3 7 8\nf 3 8 4\nf 1 5 7\nf 1 7 3\nf 2 4 8\nf 2 8 6"
    (tmp_path / "robot" / "meshes" / "pole.obj").write_text(f"{points}\n{faces}\n", encoding="utf-8")
    robot = tmp_path / "robot" / "robot.xml"
    robot.write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh name="p" file="pole.obj" scale="0.1 0.1 0.1"/></asset>'
        '<worldbody><body name="pole"><joint axis="0 1 0"/><geom type="mesh" mesh="p" mass="2"/></body></worldbody>'
        "</mujoco>",
        encoding="utf-8",
    )
    (tmp_path / "far" / "away" / "from" / "it").mkdir(parents=True)
    (tmp_path / "sibling").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "far" / "away")
    path = mount(robot, "pole").save(tmp_path / folder / "rig.xml")
    assert load_plant(model=str(path)).reduced.J1 > 0.0
    assert (str(tmp_path) in path.read_text(encoding="utf-8")) == (folder == "link")
    if folder == "link":
        assert load_plant(model=str(tmp_path / "far" / "away" / "rig.xml")).reduced.J1 > 0.0


@pytest.mark.slow
def test_a_second_axis(tmp_path: Path) -> None:
    """A universal joint, mounted twice: the hinge that was held is let go, the first pair is kept, both stand."""
    first = mount(
        mujoco.MjSpec.from_string(UNIVERSAL.format(0)), "trunk", axis="roll", name="roll", position=(0.0, 0.0, 0.15)
    )
    assert first.held == ("pitch",)
    second = mount(first.spec, "trunk", axis="pitch", name="pitch", position=(0.0, 0.0, 0.35))
    assert second.held == ()
    assert [equality.name for equality in second.spec.equalities] == []
    model = second.save("rig.xml")
    outlook = push_limits(write_scenario(model, model, "homogeneous", axis="pitch"), "pitch")
    experiment = write_scenario(model, model, "homogeneous", outlook, "pitch")
    assert experiment.plant.axis_names == ["roll", "pitch"]
    assert (
        outlook.reduced == experiment.plant.single_axis("pitch").reduced != experiment.plant.single_axis("roll").reduced
    )
    assert prepare(experiment.scenario).run_many(3, keep_trajectory=False).stood.all()
    with pytest.raises(InputError, match="no room: the modules overlap 'roll/cube1', which is there already"):
        mount(first.spec, "trunk", axis="pitch", name="pitch", position=(0.0, 0.0, 0.15))
    off = mount(
        mujoco.MjSpec.from_string(UNIVERSAL.format(0.01)), "trunk", axis="roll", name="roll", position=(0, 0, 0.15)
    )
    with pytest.raises(InputError, match=r"the hinge 'pitch' has to turn by .* deg, and the modules of another axis"):
        mount(off.spec, "trunk", axis="pitch", name="pitch", position=(0.0, 0.0, 0.35))


def test_keyframes_of_its_own_are_kept() -> None:
    text = BALL.replace(
        "</mujoco>",
        '<keyframe><key name="home" qpos="0.1 1 0 0 0 0.05"/><key name="up" qpos="0 1 0 0 0 0"/></keyframe></mujoco>',
    )
    result = mount(mujoco.MjSpec.from_string(text), "pole", keyframe="home")
    model = result.spec.compile()
    assert [model.key(i).name for i in range(model.nkey)] == ["equilibrium", "home", "up"]
    home, equilibrium = model.key("home"), model.key("equilibrium")
    assert home.qpos[0] == pytest.approx(0.1)
    assert home.qpos[5] == equilibrium.qpos[5] == pytest.approx(0.05)
    assert equilibrium.ctrl.tolist() == home.ctrl.tolist()
    assert model.equality("gripper_held").data[0] == pytest.approx(0.05)


@pytest.mark.slow
def test_the_command_prints_what_the_pair_can_do(monkeypatch: pytest.MonkeyPatch) -> None:
    without_time_limit(monkeypatch)
    arguments = ("mount", EXAMPLES / "torso.xml", "--body", "torso", "--axis", "x")
    outcome = cmg_mj(*arguments, "-o", "a.xml", "--json")
    assert outcome.status == 0, outcome.err
    figures = json.loads(outcome.out)
    assert figures["held"] == ["front_hip", "rear_hip"]
    assert figures["limit_tilt_deg"] < 2.0
    assert (
        0.0
        < figures["push_margin_worst_impulse_n_m_s"]
        <= figures["push_margin_impulse_n_m_s"]
        < figures["limit_push_impulse_n_m_s"]
    )
    assert figures["observer"] == "gyro_free"
    assert sorted(path.name for path in Path().iterdir()) == ["a.toml", "a.xml"]


def test_what_it_changes_it_says() -> None:
    text = BALL.replace('timestep="0.001" integrator="RK4"', 'timestep="0.02" solver="PGS" gravity="0.001 0 -9.8"')
    result = mount(mujoco.MjSpec.from_string(text), "pole")
    assert [note.split(" now ")[-1] for note in result.notes] == [
        "straight down",
        "RK4, which fast flywheels need",
        "Newton: another does not hold joints stiffly",
        "5 ms",
    ]
    option = result.spec.compile().opt
    assert (option.timestep, option.gravity.tolist()) == (0.005, [0.0, 0.0, pytest.approx(-9.8)])
    assert int(option.solver) == int(mujoco.mjtSolver.mjSOL_NEWTON)
    assert int(option.integrator) == int(mujoco.mjtIntegrator.mjINT_RK4)
