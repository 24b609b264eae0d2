"""A pivot that slides freely: the reduced model against the mass matrix, MuJoCo's linearisation and its sensors."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cmg_mj import mount
from cmg_mj.core.errors import InputError
from cmg_mj.features.bend import Bend, BendBeyond
from cmg_mj.features.mounting.limits import ReducedPhysics
from cmg_mj.linear.plant import linearise
from cmg_mj.plant.elements import BEND_JOINT
from cmg_mj.plant.plant import Plant, load_plant
from tests.features.bend.test_bend import frequency, ring
from tests.features.mounting.push_robots import cart_pole

SMALL = 1e-6
"""A tilt [rad] and a gimbal rate [rad/s] of which the square does not count."""


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Plant:
    return cart(tmp_path_factory.mktemp("cart"))


@pytest.fixture(scope="module")
def known(plant: Plant) -> Plant:
    """The cart again, whose tilt estimate knows that the pivot slides."""
    return Plant(plant.filed, dataclasses.replace(plant.settings, pivot_slides=True))


def cart(folder: Path, damping: float = 0.0, wheel_speed: float = 314.0) -> Plant:
    spec = mujoco.MjSpec.from_string(cart_pole(damping=damping))
    model = mount(spec, "pole", axis="hinge", release=["slider"]).save(folder / "cart.xml")
    return load_plant(
        model=str(model), equilibrium_bias_deg=0.0, initial_tilt_deg=0.0, flywheel_speed_rad_s=wheel_speed
    )


def inertias(plant: Plant) -> tuple[float, float, float, float]:
    """J about the hinge, m h and M by the mass matrix; m g h by the reduced model."""
    data = plant.new_data()
    dense = np.zeros((plant.model.nv, plant.model.nv))
    mujoco.mj_fullM(plant.model, data, dense)
    slider, hinge = (int(plant.model.joint(name).dofadr[0]) for name in ("slider", "hinge"))
    weight = plant.reduced.gimbals * plant.reduced.gravity_torque
    return dense[hinge, hinge], dense[slider, hinge], dense[slider, slider], weight


def y1_of(plant: Plant, tilt: float, gimbal_rate: float) -> float:
    """y1 that perfect accelerometers show at a tilt, while the gimbals turn."""
    data = plant.new_data()
    plant.axis.line.tilt(data, tilt)
    for module in plant.axis.modules:
        data.qvel[module.gimbal_dof] = module.direction * gimbal_rate
    mujoco.mj_forward(plant.model, data)
    return plant.pair_tilt(*plant.axis.ideal(data.sensordata.tolist(), data.qvel).accelerations)


def test_it_is_the_common_mass_centre_that_stays(plant: Plant) -> None:
    """MuJoCo's own mass centre of all says so; and the inertia left is J - (m h)^2/M."""
    model, data = plant.reduced, plant.new_data()
    pivot = float(data.joint("hinge").xanchor[2])
    J, mh, M, weight = inertias(plant)
    assert model.pivot_arm == pytest.approx(float(data.subtree_com[0, 2]) - pivot, rel=1e-9)
    assert model.pivot_arm == pytest.approx(mh / M, rel=1e-9)
    assert model.gimbals * model.J1 == pytest.approx(J - mh**2 / M, rel=1e-9)
    assert mh == pytest.approx(weight / plant.gravity, rel=1e-6)


def test_the_linearisation_is_mujocos(plant: Plant) -> None:
    model = plant.reduced
    rig, nv = linearise(plant, rigid=True, height=0.0), plant.model.nv
    slider, hinge = (int(plant.model.joint(name).dofadr[0]) for name in ("slider", "hinge"))
    gimbals = [nv + module.gimbal_dof for module in plant.axis.modules]
    both = np.array([module.direction for module in plant.axis.modules])
    tilting, sliding = rig.A[nv + hinge], rig.A[nv + slider]
    assert tilting[hinge] == pytest.approx(model.A[1, 0], rel=1e-6)
    assert tilting[gimbals] @ both == pytest.approx(model.B[1, 0], rel=1e-6)
    assert sliding[hinge] == pytest.approx(-model.pivot_arm * tilting[hinge], rel=1e-6)
    assert sliding[gimbals] @ both == pytest.approx(-model.pivot_arm * (tilting[gimbals] @ both), rel=1e-6)
    c1, d = model.measured_tilt(0.0, plant.gravity)
    assert (rig.C[3, hinge], rig.C[3, gimbals] @ both) == pytest.approx((c1, d), rel=1e-6)


@pytest.mark.parametrize("slides", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("beyond", "share"),
    [
        pytest.param("sensors", 0.02, marks=pytest.mark.slow),
        pytest.param("modules", 0.98, marks=pytest.mark.slow),
        ("both", 0.98),
    ],
)
def test_y1_of_a_frame_that_bends_on_a_cart_is_mujocos(
    plant: Plant, beyond: BendBeyond, share: float, slides: bool
) -> None:
    """The output matrix against differences of what perfect accelerometers show, state by state."""
    settings = dataclasses.replace(plant.settings, pivot_slides=slides, tilt_damping_n_m_s=0.0)
    bending = load_plant(settings, sections={"bend": Bend(20.0, 0.0, share, beyond)})
    model = bending.model
    y1 = linearise(bending).C[3]

    def y1_at(state: np.ndarray) -> float:
        data = bending.new_data()
        mujoco.mj_integratePos(model, data.qpos, state[: model.nv], 1.0)
        data.qvel += state[model.nv : 2 * model.nv]
        data.act += state[2 * model.nv :]
        mujoco.mj_forward(model, data)
        return bending.pair_tilt(*bending.axis.ideal(data.sensordata.tolist(), data.qvel).accelerations)

    slopes = [(y1_at(SMALL * column) - y1_at(-SMALL * column)) / (2.0 * SMALL) for column in np.eye(len(y1))]
    np.testing.assert_allclose(slopes, y1, rtol=1e-5, atol=1e-4)
    # The words on sliding are those of a rigid frame.
    dof = int(model.joint(BEND_JOINT).dofadr[0])
    assert not linearise(bending, rigid=True).A[model.nv + dof].any()
    assert frequency(ring(bending)[0], bending.timestep) == pytest.approx(20.0, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.0, 1.0, 30.0])
def test_damping_is_in_the_linearisation(tmp_path: Path, damping: float) -> None:
    """The pole of [[J, m h], [m h, M]] (x2', v') = (m g h x1, -D v), wheels at rest; the reduced model has no D."""
    damped = cart(tmp_path, damping=damping, wheel_speed=1e-3)
    J, mh, M, weight = inertias(damped)
    inverse = np.linalg.inv([[J, mh], [mh, M]])
    right = np.array([[weight, 0.0, 0.0], [0.0, 0.0, -damping]])
    A = np.vstack([[0.0, 1.0, 0.0], inverse @ right])
    expected = max(np.linalg.eigvals(A).real)
    assert max(np.linalg.eigvals(linearise(damped, rigid=True).A).real) == pytest.approx(expected, rel=1e-6)
    reduced = math.sqrt(damped.reduced.A[1, 0])
    assert expected < 0.97 * reduced if damping else expected == pytest.approx(reduced, rel=1e-6)


def test_accelerometers_show_what_the_reduced_model_says(plant: Plant, known: Plant) -> None:
    """About the pivot c1 x1 + d u, about the mass centre x1 alone; in MuJoCo and in the search for E."""
    c1, d = plant.reduced.measured_tilt(0.0, plant.gravity)
    assert plant.reduced.measured_tilt(plant.reduced.pivot_arm, plant.gravity) == (1.0, 0.0)
    assert (c1, d) == pytest.approx((5.514, 0.119), rel=1e-3)
    for rig, shown in ((plant, (c1, d)), (known, (1.0, 0.0))):
        physics = ReducedPhysics(rig.parameters, 2, 0.005)
        physics.x[0], physics._u = np.array([SMALL, 0.0]), np.array([0.0, SMALL])
        searched = rig.pair_tilt(*physics.reading(physics.x).accelerations)
        tried = y1_of(rig, SMALL, 0.0), y1_of(rig, 0.0, SMALL)
        assert np.asarray(tried) / SMALL == pytest.approx(shown, rel=1e-4, abs=1e-4)
        assert searched / SMALL == pytest.approx(shown, rel=1e-4, abs=1e-4)


@pytest.mark.slow
def test_far_from_upright_the_pivot_accelerates_as_the_model_says(plant: Plant) -> None:
    """At 20 deg and 1 rad/s: no force acts across, so that the mass centre of all is not accelerated there."""
    data = plant.new_data()
    plant.axis.line.tilt(data, math.radians(20.0))
    data.qvel[plant.model.joint("hinge").dofadr[0]] = 1.0
    mujoco.mj_forward(plant.model, data)
    alpha, sliding = (float(data.joint(name).qacc[0]) for name in ("hinge", "slider"))
    model = plant.reduced
    assert model.pivot_acceleration(math.radians(20.0), 1.0, alpha) == pytest.approx(sliding, rel=1e-6)


def test_the_tilt_is_taken_about_the_mass_centre(plant: Plant, known: Plant) -> None:
    """The radii count from there, negative below it; from the pivot they are what they were, and so is alpha."""
    arm = plant.reduced.pivot_arm
    tilt, about = plant.pair_tilt, known.pair_tilt
    assert (tilt.height, about.height) == (0.0, arm)
    assert (about.r_inner, about.r_outer) == (tilt.r_inner - arm, tilt.r_outer - arm)
    assert about.r_inner < 0.0 < about.r_outer
    assert about.radii == pytest.approx(tilt.radii, rel=1e-12)
    assert about.noise(0.04, 9.81).tilt < 0.5 * tilt.noise(0.04, 9.81).tilt
    assert about.acceleration(0.0, 0.0, 1.0, 0.0) == pytest.approx(tilt.acceleration(0.0, 0.0, 1.0, 0.0), rel=1e-12)


@pytest.mark.parametrize("model", ["scissored_pair.xml", pytest.param("two_axes.xml", marks=pytest.mark.slow)])
def test_a_pivot_at_rest_is_what_it_was(model: str) -> None:
    """Its arm is exactly zero, its accelerometers' tilt that of the file; to say that it slides is a mistake."""
    plant = load_plant(model=model)
    for axis, filed in zip(plant.axes, plant.filed.axes, strict=True):
        assert axis.reduced.pivot_arm == 0.0
        assert axis.pair_tilt == filed.pair_tilt
        assert axis.reduced.measured_tilt(0.0, plant.gravity) == (1.0, 0.0)
    assert not plant.reduced.pivot_arm
    with pytest.raises(InputError, match=r"plant.pivot_slides = true: .*the pivot.* does not slide freely; leave it"):
        load_plant(model=model, pivot_slides=True)


TWO_JOINTS = """
<mujoco><option timestep="0.005" integrator="RK4"/><worldbody>
  <body pos="0 0 1"><joint name="lower" type="{kind}" axis="{axis}"/><geom type="box" size="0.2 0.15 0.1" mass="1"/>
    <body name="pole" pos="0 0 0.2"><joint name="hinge" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 1" size="0.045" mass="0.1"/></body></body>
</worldbody></mujoco>
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "axis", "slides"),
    [("slide", "1 0 1", True), ("slide", "-1 0 0", True), ("slide", "0 1 0", False), ("hinge", "0 1 0", False)],
)
def test_only_what_slides_across_counts(tmp_path: Path, kind: str, axis: str, slides: bool) -> None:
    """On a slope of 45 deg half of the way is across; along the axis none is; what turns with the rig is no slide."""
    spec = mujoco.MjSpec.from_string(TWO_JOINTS.format(kind=kind, axis=axis))
    model = mount(spec, "pole", axis="hinge", release=["lower"]).save(tmp_path / "rig.xml")
    plant = load_plant(model=str(model), equilibrium_bias_deg=0.0, initial_tilt_deg=0.0)
    expected = mass_centre(plant, "lower") * (0.5 if axis == "1 0 1" else 1.0) if slides else 0.0
    assert plant.reduced.pivot_arm == pytest.approx(expected, rel=1e-9)


def mass_centre(plant: Plant, joint: str) -> float:
    """Height of the common mass centre of all that a joint carries above the hinge: m h/M."""
    data = plant.new_data()
    body = int(plant.model.jnt_bodyid[plant.model.joint(joint).id])
    pole = plant.model.body("pole").id
    share = plant.model.body_subtreemass[pole] / plant.model.body_subtreemass[body]
    return float(share * (data.subtree_com[pole, 2] - data.joint("hinge").xanchor[2]))
