"""Two axes about which one free body tilts: both lines' torques act on the same joint, and each is felt."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest

from cmg_mj.features.mounting import mount
from cmg_mj.plant.tilt_line import SupportLine
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from tests.recorded import assert_same_bits, recorded

POST = """
<mujoco model="post">
  <worldbody>
    <geom type="plane" size="4 4 0.1" friction="1.5 0.05 0.001" condim="4"/>
    <body name="post" pos="0 0 0.62">
      <freejoint/>
      <geom type="box" size="0.12 0.12 0.16" mass="4"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.59" size="0.03" mass="0.8" friction="1.5 0.05 0.001" condim="4"/>
      <geom name="foot" type="capsule" fromto="-0.1 0 -0.59 0.1 0 -0.59" size="0.03" mass="0" condim="4"/>
    </body>
  </worldbody>
</mujoco>"""
SET = (
    "duration_s=0.35",
    "plant.turn_rate_rad_s=0",
    "plant.equilibrium_bias_deg=0",
    "plant.initial_tilt_deg=0",
    "axes={}",
)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("post")
    one = mount(mujoco.MjSpec.from_string(POST), body="post", axis="x", scale=1.3, name="roll").spec
    one.geom("foot").fromto = [0.0, -0.1, -0.59, 0.0, 0.1, -0.59]
    two = mount(one, body="post", axis="y", scale=1.3, name="pitch", position=(0.0, 0.0, 0.55))
    two.spec.delete(two.spec.geom("foot"))  # on a point, on which no robot is mounted
    return two.save(folder / "two.xml")


def pushed(model: Path, **torques: float) -> Experiment:
    pushes = ",".join(f"{{start_s=0.15, torque_n_m={torque}, axis='{axis}'}}" for axis, torque in torques.items())
    return prepare(load_scenario("two_axes", [*SET, f"plant.model={model}", f"push=[{pushes}]"]))


@pytest.mark.daily_cases("roll-pitch")
@pytest.mark.parametrize(("axis", "other"), [("roll", "pitch"), ("pitch", "roll")])
def test_a_push_about_either_axis_is_felt_there(model: Path, axis: str, other: str) -> None:
    without = pushed(model)
    quiet = recorded(without.run())
    experiment = pushed(model, **{axis: 12.0})
    one = recorded(experiment.run())
    assert_same_bits(recorded(experiment.run_many(2)).world(0), one)
    after = round(0.25 / 0.005)
    rate = {name: one[f"{name}/x2_rad_s"][after] - quiet[f"{name}/x2_rad_s"][after] for name in (axis, other)}
    plant = without.plant
    assert all(isinstance(axis.line, SupportLine) for axis in plant.axes)
    inertia = plant.single_axis(axis).reduced.gimbals * plant.single_axis(axis).reduced.J1
    assert rate[axis] == pytest.approx(12.0 * 0.1 / inertia, rel=0.3)  # the controller is at it meanwhile
    assert abs(rate[other]) < 0.05 * rate[axis]
