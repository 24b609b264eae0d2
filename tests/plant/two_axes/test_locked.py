"""An axis that is locked: its hinge is gone, its modules are not, and the other axis is what it was."""

from __future__ import annotations

import math
import shutil
from dataclasses import astuple
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.inputs.files import folder
from cmg_mj.plant.locking import remove_hinge
from cmg_mj.plant.plant import load_plant

MODELS = ["two_axes.xml", "two_axes_free_base.xml"]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("locked", "left", "axis_index"), [("pitch", "roll", 0), ("roll", "pitch", 1)])
def test_the_other_axis_is_what_it_was(model: str, locked: str, left: str, axis_index: int) -> None:
    whole, plant = load_plant(model=model), load_plant(model=model, locked_axes=[locked])
    assert plant.axis_names == [left]
    assert plant.joint_names == [name for name in whole.joint_names if name != locked]
    np.testing.assert_allclose(astuple(plant.reduced), astuple(whole.axes[axis_index].reduced), rtol=1e-9)
    np.testing.assert_allclose(plant.pair_tilt.places, whole.axes[axis_index].pair_tilt.places)
    assert plant.drawn_model.nv == plant.model.nv


def test_its_wheels_turn_and_its_gimbals_hold() -> None:
    """For a second, while the rig falls about the other axis."""
    plant = load_plant(model="two_axes.xml", locked_axes=["pitch"], initial_tilt_deg=0.1)
    data = plant.new_data()
    mujoco.mj_step(plant.model, data, 200)
    assert abs(math.degrees(plant.axis.line.lean(data.qpos))) > 10.0
    for module, speed in (("pitch/cube1", 314.0), ("pitch/cube2", -314.0)):
        assert data.joint(f"{module}/flywheel").qvel[0] == pytest.approx(speed, rel=1e-3)
        assert data.joint(f"{module}/gimbal").qpos[0] == pytest.approx(math.pi / 2.0, abs=2e-2)


def test_what_changes_all_wheels_and_gimbals_changes_those_that_are_held() -> None:
    plant = load_plant(
        model="two_axes.xml", locked_axes=["pitch"], flywheel_speed_rad_s=200.0, gimbal_friction_n_m=0.01
    )
    data = plant.new_data()
    for module, speed in (("pitch/cube1", 200.0), ("pitch/cube2", -200.0), ("roll/cube1", 200.0)):
        assert data.joint(f"{module}/flywheel").qvel[0] == speed
        assert data.actuator(f"{module}/flywheel_motor").ctrl[0] == speed
        assert plant.model.joint(f"{module}/gimbal").frictionloss[0] == 0.01


@pytest.mark.parametrize("orientation", ['euler="0 -0.3 0"', 'quat="0.98877107793604228 0 -0.14943813247359922 0"'])
def test_it_is_locked_where_it_stands_at_the_keyframe(orientation: str, tmp_path: Path) -> None:
    """A hinge whose zero is not upright, its point beside its body's own: taken out, the frame stands as before."""
    for path in folder("models").glob("*.xml"):
        shutil.copy(path, tmp_path)
    upper, whole = tmp_path / "two_axes_upper.xml", tmp_path / "two_axes.xml"
    upper.write_text(upper.read_text().replace('<body name="frame">', f'<body name="frame" {orientation}>'))
    whole.write_text(whole.read_text().replace('qpos="0 0 0 1.57', 'qpos="0 0 0.3 1.57'))
    tilted_plant = load_plant(model=str(whole), locked_axes=["pitch"])
    upright = load_plant(model="two_axes.xml", locked_axes=["pitch"])
    np.testing.assert_allclose(astuple(tilted_plant.reduced), astuple(upright.reduced), rtol=1e-9)
    whole.write_text(whole.read_text().replace('qpos="0 0 0.3 1.57', 'qpos="0 0 0 1.57'))
    with pytest.raises(InputError, match=r"leans by -17\.2 deg"):
        load_plant(model=str(whole), locked_axes=["pitch"])


WRONG = [
    ("two_axes.xml", ["pich"], "has no axis 'pich'; did you mean 'pitch'? its axes: pitch, roll"),
    ("two_axes.xml", ["roll", "pitch"], "would have no axis left to tilt about; leave one of 'roll', 'pitch'"),
    ("scissored_pair.xml", ["roll"], "has no axis 'roll'; its only one has no name"),
]


@pytest.mark.parametrize(("model", "axes", "line"), WRONG)
def test_what_cannot_be_locked_is_said_in_one_line(model: str, axes: list[str], line: str) -> None:
    with pytest.raises(InputError) as info:
        load_plant(model=model, locked_axes=axes)
    assert str(info.value).endswith(line)
    assert "\n" not in str(info.value)
    assert str(info.value).startswith(f"plant.locked_axes = {axes}: ")


def test_what_drives_reads_or_holds_a_hinge_goes_with_it() -> None:
    """And its numbers in keyframes, between those of others."""
    spec = mujoco.MjSpec.from_string("""
    <mujoco>
      <worldbody>
        <body><freejoint name="base"/><geom size="0.1"/>
          <body><joint name="a"/><geom size="0.1"/>
            <body><joint name="b"/><geom size="0.1"/>
              <body><joint name="c"/><geom size="0.1"/></body>
            </body>
          </body>
        </body>
      </worldbody>
      <actuator>
        <intvelocity name="a" joint="a" kp="1"/>
        <velocity name="b1" joint="b" kv="1"/>
        <intvelocity name="b2" joint="b" kp="1"/>
        <intvelocity name="c" joint="c" kp="1"/>
      </actuator>
      <sensor><jointpos name="b" joint="b"/><jointpos name="c" joint="c"/></sensor>
      <equality><joint joint1="a" joint2="b"/><joint joint1="a" joint2="c"/></equality>
      <keyframe>
        <key name="full" qpos="0 0 0 1 0 0 0 1 2 3" qvel="0 0 0 0 0 0 1 2 3" act="1 2 3" ctrl="1 2 2 3"/>
        <key name="short" qpos="0 0 0 1 0 0 0 1 2 3"/>
      </keyframe>
    </mujoco>""")
    remove_hinge(spec, "b")
    model = spec.compile()
    assert (model.nu, model.nsensor, model.neq) == (2, 1, 1)
    np.testing.assert_array_equal(model.key_qpos[:, 7:], [[1, 3], [1, 3]])
    np.testing.assert_array_equal(model.key_qvel[0, 6:], [1, 3])
    np.testing.assert_array_equal(model.key_act[0], [1, 3])
    np.testing.assert_array_equal(model.key_ctrl[0], [1, 3])


# --- turning ------------------------------------------------------------------------------------------------


def test_it_turns_from_the_start_and_its_servo_holds_that() -> None:
    plant = load_plant(model="two_axes.xml", turn_rate_rad_s=2.0, equilibrium_bias_deg=0.0, initial_tilt_deg=0.0)
    data = plant.new_data()
    yaw = plant.model.joint("yaw")
    assert data.qvel[yaw.dofadr[0]] == data.actuator("yaw_servo").ctrl[0] == 2.0
    mujoco.mj_step(plant.model, data, 20)
    assert data.qvel[yaw.dofadr[0]] == pytest.approx(2.0, rel=1e-6)
    assert data.qpos[yaw.qposadr[0]] == pytest.approx(0.2, rel=1e-6)


@pytest.mark.parametrize(
    "fields", [{"model": "scissored_pair.xml"}, {"model": "two_axes.xml", "lock_thrust_bearing": True}]
)
def test_what_cannot_turn_says_so(fields: dict) -> None:
    with pytest.raises(InputError, match=r"^plant.turn_rate_rad_s = 1: .* has no actuator 'yaw_servo' that drives"):
        load_plant(**fields, turn_rate_rad_s=1.0)
