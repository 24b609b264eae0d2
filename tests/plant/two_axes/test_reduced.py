"""The reduced model of each axis against the full model's own unstable poles, fixed and on a base that is free."""

from __future__ import annotations

import copy
import math
from dataclasses import astuple

import mujoco
import numpy as np
import pytest

from cmg_mj.plant.inertia import inertia_about
from cmg_mj.plant.plant import Plant, load_plant

MODELS = ["two_axes.xml", "two_axes_free_base.xml"]


@pytest.fixture(scope="module", params=MODELS)
def plant(request: pytest.FixtureRequest) -> Plant:
    return load_plant(model=request.param, equilibrium_bias_deg=0.0)


def unstable_poles(plant: Plant) -> np.ndarray:
    """Return the growing poles of the full model, linearised at its keyframe [1/s]."""
    model = copy.copy(plant.model)
    model.opt.integrator, model.opt.timestep = int(mujoco.mjtIntegrator.mjINT_EULER), 1e-4  # RK4 is refused here
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, plant.key)
    mujoco.mj_forward(model, data)
    transition = np.zeros((2 * model.nv + model.na,) * 2)
    mujoco.mjd_transitionFD(model, data, 1e-6, True, transition, None, None, None)
    poles = np.log(np.linalg.eigvals(transition).astype(complex)) / model.opt.timestep
    return np.sort(poles.real[poles.real > 0.01])


def test_what_grows_is_what_the_reduced_models_say(plant: Plant) -> None:
    """The tilt turns the gimbals against their servos' stiffness, which adds H^2/k to what it feels.

    k is the servo's stiffness at the pole's own pace. Nothing else is left out: with a base that gave way the pole
    would be 12.8/s.
    """
    result = unstable_poles(plant)
    kp, kv, gimbal = 85.6, 0.731, 1.56e-3
    for axis, pole in zip(plant.axes, result, strict=True):
        momentum = axis.reduced.J_d * axis.reduced.omega_d
        stiffness = kp + kv * pole + gimbal * pole**2
        expected = math.sqrt(axis.reduced.gravity_torque / (axis.reduced.J1 + momentum**2 / stiffness))
        assert pole == pytest.approx(expected, rel=5e-4)


def test_both_rigs_have_the_same_reduced_models() -> None:
    """The floor holds the base as the world holds the thrust bearing."""
    fixed_base, free_base = (load_plant(model=name, equilibrium_bias_deg=0.0) for name in MODELS)
    for one, other in zip(fixed_base.axes, free_base.axes, strict=True):
        np.testing.assert_allclose(astuple(one.reduced), astuple(other.reduced), rtol=1e-9)


def test_it_is_about_the_robot_that_was_measured(plant: Plant) -> None:
    """10.9 kg, 0.133 m, 0.342 kg m^2, a pole of 6.44/s; the cross turns with roll alone."""
    roll, pitch = (axis.reduced for axis in plant.axes)
    mass, inertia = float(plant.model.body("frame").subtreemass[0]), 2.0 * pitch.J1
    assert mass == pytest.approx(10.9)
    assert 2.0 * pitch.gravity_torque / (mass * 9.81) == pytest.approx(0.1327, abs=1e-4)
    assert inertia == pytest.approx(0.3422, abs=1e-4)
    assert 2.0 * roll.J1 - inertia == pytest.approx(3e-5, rel=1e-9)
    assert pitch.J_d * pitch.omega_d / pitch.J1 == pytest.approx(2.019, abs=1e-3)
    assert [axis.directions for axis in plant.axes] == [[1.0, -1.0], [1.0, -1.0]]


def test_a_base_in_the_air_gives_way() -> None:
    plant = load_plant(model="two_axes_free_base.xml", equilibrium_bias_deg=0.0)
    model = copy.copy(plant.model)
    model.key_qpos[plant.key, 2] += 0.01
    for axis in plant.axes:
        standing = inertia_about(plant.model, plant.key, axis.line, {}).tilt_inertia
        assert inertia_about(model, plant.key, axis.line, {}).tilt_inertia < 0.3 * standing


def test_a_base_on_two_feet_gives_way_about_the_line_between_them() -> None:
    """The feet along x, of four in a square, hold a roll no more, and a pitch as before."""
    plant = load_plant(model="two_axes_free_base.xml", equilibrium_bias_deg=0.0)
    model = copy.copy(plant.model)
    for foot, y in (("foot_nn", 0.0), ("foot_pn", 0.0), ("foot_np", None), ("foot_pp", None)):
        geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, foot)
        if y is None:
            model.geom_contype[geom] = model.geom_conaffinity[geom] = 0
        else:
            model.geom_pos[geom, 1] = y
    roll, pitch = (inertia_about(model, plant.key, axis.line, {}).tilt_inertia for axis in plant.axes)
    assert roll < 0.9 * 2.0 * plant.axes[0].reduced.J1
    assert pitch == pytest.approx(2.0 * plant.axes[1].reduced.J1, rel=1e-9)
