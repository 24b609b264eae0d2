"""The plan of a walk against the pendulum's equation, MuJoCo's inverse dynamics and its kinematics."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.gait import Gait
from cmg_mj.features.gait.legs import Walk, plan_walk
from cmg_mj.features.gait.plan import Plan
from cmg_mj.plant.plant import Plant, load_plant

GAIT, DT, POLE = Gait(steps=4, single_s=0.4, double_s=0.3), 0.005, 5.3


@pytest.fixture(scope="module")
def plant() -> Plant:
    return load_plant(model="biped", equilibrium_bias_deg=0.0, initial_tilt_deg=0.0)


@pytest.fixture(scope="module")
def walk(plant: Plant) -> Walk:
    return plan_walk(plant.model, plant.key, GAIT, DT)


def test_the_mass_centre_obeys_the_pendulum_and_stays_bounded() -> None:
    plan, dt = Plan(GAIT, 0.045), 1e-3
    time = dt * np.arange(round(plan.duration_s / dt))
    point, centre = plan.zero_moment_point(time), plan.mass_centre(time, POLE)
    acceleration = np.diff(centre, 2, axis=0) / dt**2
    np.testing.assert_allclose(acceleration, (POLE**2 * (centre - point))[1:-1], atol=2e-3)
    assert np.abs(acceleration).max() > 0.5
    assert np.abs(centre - point).max() < 0.03
    np.testing.assert_allclose(centre[[0, -1]], [[0.0, 0.0], [0.3, 0.0]], atol=1e-4)


def test_the_whole_robots_zero_moment_point_lies_where_the_feet_carry(walk: Walk) -> None:
    """Within the passes each leaves a tenth; without them it is off by over a millimetre."""
    wanted = np.einsum("fn,fni->ni", walk.plan.load(walk.time), walk.feet[:, :, :2])
    assert np.abs(walk.zero_moment_point - wanted)[2:-2].max() < 1e-6


def test_the_soles_are_where_they_should_be(plant: Plant, walk: Walk) -> None:
    data = mujoco.MjData(plant.model)
    sites = [plant.model.site(f"{side}/foot").id for side in ("left", "right")]
    for i in range(0, len(walk.time), 7):
        data.qpos[:] = walk.qpos[i]
        mujoco.mj_kinematics(plant.model, data)
        off = data.site_xpos[sites] - walk.feet[:, i]
        np.testing.assert_allclose(off[:, :2], 0.0, atol=1e-4)
        np.testing.assert_allclose(off[:, 2], 0.012, atol=2e-4)  # the balls' radius, less what the floor gives


def test_feet_that_stand_roll_without_slip(plant: Plant, walk: Walk) -> None:
    """The lowest point of each ball is at rest, by MuJoCo's Jacobian; else it slips by 11 mm/s."""
    model, data = plant.model, mujoco.MjData(plant.model)
    stands = walk.plan.load(walk.time) > 0.0
    slip = []
    for i in range(0, len(walk.time), 5):
        data.qpos[:], data.qvel[:] = walk.qpos[i], walk.qvel[i]
        data.qvel[:][np.abs(data.qvel) > 100.0] = 0.0  # the wheels
        mujoco.mj_fwdPosition(model, data)
        for foot, side in enumerate(("left", "right")):
            site, jacobian = model.site(f"{side}/foot").id, np.zeros((3, model.nv))
            mujoco.mj_jac(
                model, data, jacobian, None, data.site_xpos[site] - [0.0, 0.0, 0.012], model.site_bodyid[site]
            )
            if stands[foot, i]:
                slip.append(np.abs((jacobian @ data.qvel)[:2]).max())
    assert max(slip) < 5e-3


def test_one_foot_carries_all_or_both_share(walk: Walk) -> None:
    load = walk.plan.load(walk.time)
    np.testing.assert_allclose(load.sum(axis=0), 1.0, rtol=1e-12)
    lifted = walk.plan.feet(walk.time)[:, :, 2] > 1e-6
    assert not load[lifted].any()
    assert not lifted.all(axis=0).any()


def test_a_robot_without_legs_is_refused() -> None:
    plant = load_plant()
    with pytest.raises(InputError, match=r"gait\.steps: takes a free robot with sites and <touch> sensors LEG/foot"):
        plan_walk(plant.model, plant.key, GAIT, DT)
