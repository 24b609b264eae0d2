"""The compiled models against the papers' own derivation: mass matrix, accelerations, gravity, parameters."""

from __future__ import annotations

import math
from dataclasses import astuple

import mujoco
import numpy as np
import pytest

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.plant.plant import Plant, load_plant
from tests.plant import paper_model as paper
from tests.plant.full_model import mass_matrices, passive, states

N_STATES = 1_000
UPRIGHT = -math.pi / 4.0  # q_b at which the cubes stand on their edge


@pytest.fixture(scope="module")
def plant() -> Plant:
    return load_plant(equilibrium_bias_deg=0.0)


@pytest.fixture(scope="module")
def single() -> Plant:
    return load_plant(model="single_gimbal.xml", equilibrium_bias_deg=0.0, lock_thrust_bearing=True)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(2020)


def bearing_inertia(plant: Plant) -> float:
    """K_a, which Table 1 does not give: the one number taken from the model."""
    return float(plant.model.body("thrust_bearing").inertia[2])


def random_motion(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Any angles, rates of a few rad/s with the flywheels around their speed, torques of a few N m."""
    angles = rng.uniform(-math.pi, math.pi, (N_STATES, 6))
    rates = rng.uniform(-5.0, 5.0, (N_STATES, 6))
    rates[:, [3, 5]] += paper.omega_d * rng.uniform(0.8, 1.2, (N_STATES, 2)) * [1.0, -1.0]
    return angles, rates, rng.uniform(-3.0, 3.0, (N_STATES, 6))


# --- the six bodies of aranovskiy2020 -----------------------------------------------------------------------


def test_mass_matrix_is_the_papers_but_for_its_missing_yaw_term(plant: Plant, rng: np.random.Generator) -> None:
    angles, _, _ = random_motion(rng)
    difference = mass_matrices(plant.model, angles)
    difference -= paper.scissored_pair(bearing_inertia(plant), yaw_term=False).mass_matrix(angles)
    yaw_term = np.zeros_like(difference)
    yaw_term[:, 0, 0] = paper.m * paper.l**2 * np.sin(angles[:, 1] - UPRIGHT) ** 2
    np.testing.assert_allclose(difference, yaw_term, rtol=0.0, atol=1e-10)


def test_accelerations_are_those_of_euler_lagrange(plant: Plant, rng: np.random.Generator) -> None:
    """(1) with applied torques. Errors are relative to each coordinate's own rms acceleration."""
    angles, rates, torques = random_motion(rng)
    ours = np.array([data.qacc.copy() for data in states(passive(plant), angles, rates, torques)])
    theirs = paper.scissored_pair(bearing_inertia(plant)).accelerations(angles, rates, torques)
    scale = np.sqrt(np.mean(theirs**2, axis=0))
    assert np.all(np.abs(ours - theirs).max(axis=0) < 1e-9 * scale)


def test_reduced_parameters_are_those_of_table_1(plant: Plant) -> None:
    table_1 = ReducedModel(paper.J1, paper.J2, paper.J_d, paper.omega_d, paper.gravity_torque, gimbals=2)
    np.testing.assert_allclose(astuple(plant.reduced), astuple(table_1), rtol=1e-12)
    assert [module.direction for module in plant.axis.modules] == [1.0, -1.0]


# --- the equilibrium bias e ---------------------------------------------------------------------------------


@pytest.mark.parametrize("bias_deg", [-1.5, 1.5])
def test_bias_turns_gravity_as_P_says(bias_deg: float, rng: np.random.Generator) -> None:
    """-dP/dq_b with P = sqrt(2) m g l cos(q_b + pi/4 + e), whatever the gimbals do."""
    plant = load_plant(equilibrium_bias_deg=bias_deg)
    angles, _, _ = random_motion(rng)
    torques = np.array([-data.qfrc_bias for data in states(plant.model, angles)])
    expected = np.zeros_like(torques)
    tilt = angles[:, 1] - UPRIGHT + math.radians(bias_deg)
    expected[:, 1] = math.sqrt(2.0) * paper.m * paper.g * paper.l * np.sin(tilt)
    np.testing.assert_allclose(torques, expected, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("bias_deg", [-1.5, 1.5])
def test_bias_changes_the_inertia_by_the_parallel_axis_theorem(
    plant: Plant, bias_deg: float, rng: np.random.Generator
) -> None:
    """The frame (mass M_b) carries the whole rig's centre of mass round the pivot.

    With M = 2 m and c the rig's centre, the frame's own moves from c to c + M/M_b (R(e) - 1) c. The inertia
    about the tilt axis grows by 2 M |c|^2 (M/M_b - 1)(1 - cos e), |c|^2 = l^2/2; half of that is J1's. Else
    only the yaw's entry of the mass matrix moves, by M_b times the change of the squared distance.
    """
    other_plant = load_plant(equilibrium_bias_deg=bias_deg)
    e = math.radians(bias_deg)
    M, M_b = 2.0 * paper.m, float(plant.model.body("frame").mass[0])
    assert plant.model.body("frame").subtreemass[0] == pytest.approx(M, rel=1e-12)

    centre = np.array([paper.l / 2.0, paper.l / 2.0])  # x and z in B
    rotated_centre = np.array([[math.cos(e), math.sin(e)], [-math.sin(e), math.cos(e)]]) @ centre
    frame = centre + M / M_b * (rotated_centre - centre)
    angles, _, _ = random_motion(rng)
    expected = np.zeros((N_STATES, 6, 6))
    expected[:, 1, 1] = M * paper.l**2 * (M / M_b - 1.0) * (1.0 - math.cos(e))
    horizontal = np.stack([np.cos(angles[:, 1]), np.sin(angles[:, 1])], axis=-1)
    expected[:, 0, 0] = M_b * ((horizontal @ frame) ** 2 - (horizontal @ centre) ** 2)
    change = mass_matrices(other_plant.model, angles) - mass_matrices(plant.model, angles)
    np.testing.assert_allclose(change, expected, rtol=0.0, atol=1e-12)

    change_of_J1 = float(change[0, 1, 1]) / 2.0
    assert change_of_J1 == pytest.approx(1.874e-5, rel=1e-3)
    assert other_plant.reduced == plant.reduced  # the controller does not know


def test_imbalance_is_a_weight_that_turns_with_the_flywheel(plant: Plant, rng: np.random.Generator) -> None:
    first_moment = 1e-5
    unbalanced = load_plant(equilibrium_bias_deg=0.0, flywheel_imbalance_kg_m=first_moment)
    angles, _, _ = random_motion(rng)
    torques = np.array([data.qfrc_bias.copy() for data in states(unbalanced.model, angles)])
    torques -= [data.qfrc_bias.copy() for data in states(plant.model, angles)]
    expected = paper.flywheel_weights(first_moment).bias(angles, np.zeros_like(angles))
    np.testing.assert_allclose(torques, expected, rtol=0.0, atol=1e-13)


# --- the three bodies of sokolov2019 ------------------------------------------------------------------------


def test_single_gimbal_has_the_mass_matrix_of_three_bodies(single: Plant, rng: np.random.Generator) -> None:
    assert single.joint_names == ["tilt", "cube1/gimbal", "cube1/flywheel"]
    angles = rng.uniform(-math.pi, math.pi, (N_STATES, 3))
    ours = mass_matrices(single.model, angles)
    np.testing.assert_allclose(ours, paper.single_gimbal().mass_matrix(angles), rtol=0.0, atol=1e-10)


def test_single_gimbal_obeys_the_printed_equations(single: Plant, rng: np.random.Generator) -> None:
    """sokolov2019 (1), its three torques at any state and acceleration."""
    J1, J2 = paper.J1_single, paper.J2
    spin = np.array([0.0, 0.0, paper.omega_d])
    data = mujoco.MjData(single.model)
    for _ in range(N_STATES):
        q_b, q_c, _ = data.qpos[:] = rng.uniform(-math.pi, math.pi, 3)
        w_b, w_c, w_d = data.qvel[:] = rng.uniform(-5.0, 5.0, 3) + spin
        dw_b, dw_c, dw_d = data.qacc[:] = rng.uniform(-100.0, 100.0, 3)
        mujoco.mj_inverse(single.model, data)
        cos, sin, sin2 = math.cos(q_c), math.sin(q_c), math.sin(2.0 * q_c)
        left_sides = [
            (J1 + J2 * cos**2) * dw_b
            - J2 * sin2 * w_c * w_b
            + paper.J_d * dw_d * cos
            - paper.J_d * sin * w_c * w_d
            - paper.m * paper.l_single * paper.g * math.sin(q_b - UPRIGHT),
            (paper.I_c + paper.I_d) * dw_c + paper.J_d * w_b * w_d * sin + J2 / 2.0 * sin2 * w_b**2,
            paper.J_d * dw_d + paper.J_d * cos * dw_b - paper.J_d * sin * w_c * w_b,
        ]
        np.testing.assert_allclose(data.qfrc_inverse, left_sides, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("locked", [True, False])
def test_single_gimbal_has_the_parameters_of_its_paper(locked: bool) -> None:
    reduced = load_plant(model="single_gimbal.xml", lock_thrust_bearing=locked).reduced
    gravity_torque = paper.m * paper.g * paper.l_single
    table_1 = ReducedModel(paper.J1_single, paper.J2, paper.J_d, paper.omega_d, gravity_torque)
    np.testing.assert_allclose(astuple(reduced), astuple(table_1), rtol=1e-12)
