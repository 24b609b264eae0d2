"""A mounted robot through all that runs a rig: it is one like the others, on a hinge or on its feet."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import cmg_mj
from cmg_mj.features.gymnasium import ScissoredPairEnv
from cmg_mj.features.mounting import mount
from cmg_mj.features.mounting.write import write_scenario
from cmg_mj.laws import StateFeedback, scaled_gains
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from tests.features.gymnasium.test_gymnasium_env import act
from tests.features.mounting.robots import ROBOTS
from tests.recorded import assert_same_bits, recorded

PUSH_SETTINGS = ["duration_s=1.0", "plant.initial_tilt_deg=0.2", "push=[{start_s=0.25,torque_n_m=1.0}]"]

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.fixture(scope="module", params=["bicycle", "inverted_double_pendulum, its joint held"])
def scenario(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A scenario file: of a robot that stands on the floor, and of one on a hinge."""
    robot = ROBOTS[request.param]
    model = mount(robot.path, **robot.options).save(tmp_path_factory.mktemp("robot") / "balanced.xml")
    write_scenario(model, robot.path, "homogeneous")
    return str(model.with_suffix(".toml"))


def open_experiment(scenario: str) -> Experiment:
    return prepare(load_scenario(scenario, PUSH_SETTINGS))


@pytest.mark.daily_cases("bicycle")
def test_the_callback_and_a_batch_give_the_runners_trajectory(scenario: str) -> None:
    experiment = open_experiment(scenario)
    native = experiment.run()
    assert native.stood.all()
    assert_same_bits(recorded(experiment.run("callback")), recorded(native))
    assert_same_bits(recorded(experiment.run_many(2)).world(0), recorded(native))


@pytest.mark.daily_cases("bicycle")
def test_the_environment_gives_it_too(scenario: str) -> None:
    env = ScissoredPairEnv(scenario, PUSH_SETTINGS, in_rad_s=True)
    ticks, infos, _ = act(env, 0)
    trajectory = recorded(open_experiment(scenario).run())
    assert len(ticks) == 200
    for name in ("x1_rad", "x2_rad_s", "x3_rad"):
        np.testing.assert_array_equal([info[name] for info in infos[:-1]], trajectory[name])


STICK = """
<mujoco>
  <option timestep="{step}"/>
  <worldbody>
    <body name="stick" pos="0 0 0.1">
      <joint name="lean" type="hinge" axis="1 0 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.8" size="0.03" density="800"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("step", [0.0007, 0.002, 0.003, 0.005])
def test_it_stands_in_ones_own_loop_with_gains_of_its_own_and_the_papers_are_hinted_at(
    step: float, caplog: pytest.LogCaptureFixture
) -> None:
    """Whole physics steps fill the 5 ms between two decisions, whatever the model file's step is."""
    spec = mujoco.MjSpec.from_string(STICK.format(step=step))
    path = str(mount(spec, "stick", axis="lean").save("balanced.xml"))
    assert cmg_mj.load_plant(model=path, initial_tilt_deg=0.5).settings.initial_tilt_deg == 0.5
    plant = cmg_mj.load_plant(model=path)
    assert plant.settings.initial_tilt_deg == plant.settings.equilibrium_bias_deg == 0.0
    assert plant.timestep <= step
    law = StateFeedback(dt=0.005, gains=scaled_gains(plant.reduced))
    cmg_mj.controller(cmg_mj.load_plant())
    for given, stands in ((law, True), (None, False)):
        assert not caplog.records
        controller, data = cmg_mj.controller(plant, "gyro_free", law=given), plant.new_data()
        with cmg_mj.control_callback(plant, controller):
            while data.time < 3.0:
                mujoco.mj_step(plant.model, data)
        assert (abs(data.qpos[plant.tilt] - plant.tilt_zero) < 0.1) == stands
    assert "the closed loop is unstable" in caplog.text
    assert "scaled_gains(plant.reduced)" in caplog.text
