"""The compiled two-axis rig against an independent derivation: mass matrix, gravity, accelerations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cmg_mj.plant.plant import Plant, load_plant
from tests.plant.full_model import mass_matrices, passive, states
from tests.plant.two_axes.chain import MODULES, Chain, N

N_STATES = 500
WHEELS = [4, 6, 8, 10]


@pytest.fixture(scope="module")
def plant() -> Plant:
    return load_plant(model="two_axes.xml", equilibrium_bias_deg=0.0)


@pytest.fixture(scope="module")
def chain() -> Chain:
    return Chain()


@pytest.fixture
def angles() -> np.ndarray:
    return np.random.default_rng(2020).uniform(-math.pi, math.pi, (N_STATES, N))


def test_its_coordinates_are_those_of_the_derivation(plant: Plant) -> None:
    module_joints = [f"{module}/{joint}" for module in MODULES for joint in ("gimbal", "flywheel")]
    assert plant.joint_names == ["yaw", "roll", "pitch", *module_joints]


def test_mass_matrix(plant: Plant, chain: Chain, angles: np.ndarray) -> None:
    ours, theirs = mass_matrices(plant.model, angles), chain.mass_matrix(angles)
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-12)
    assert np.abs(theirs[:, 0, 1:3]).max() > 1e-2  # yaw couples with the tilts where the rig leans


def test_gravity(plant: Plant, chain: Chain, angles: np.ndarray) -> None:
    ours = np.array([-data.qfrc_bias for data in states(plant.model, angles)])
    np.testing.assert_allclose(ours, -chain.bias(angles, 0.0 * angles), rtol=0.0, atol=1e-12)


def test_accelerations_are_those_of_lagrange(plant: Plant, chain: Chain, angles: np.ndarray) -> None:
    """At any rates and torques, to 1e-9 of each coordinate's own rms acceleration."""
    rng = np.random.default_rng(2021)
    rates, torques = rng.uniform(-5.0, 5.0, (N_STATES, N)), rng.uniform(-3.0, 3.0, (N_STATES, N))
    rates[:, WHEELS] += 314.0 * rng.uniform(0.8, 1.2, (N_STATES, 4)) * [1.0, -1.0, 1.0, -1.0]
    ours = np.array([data.qacc.copy() for data in states(passive(plant), angles, rates, torques)])
    theirs = chain.accelerations(angles, rates, torques)
    assert np.all(np.abs(ours - theirs).max(axis=0) < 1e-9 * np.sqrt(np.mean(theirs**2, axis=0)))


def test_a_locked_axis_leaves_the_same_rig_without_its_row(chain: Chain, angles: np.ndarray) -> None:
    for axis, row in (("roll", 1), ("pitch", 2)):
        locked = load_plant(model="two_axes.xml", equilibrium_bias_deg=0.0, locked_axes=[axis])
        others = [i for i in range(N) if i != row]
        upright = angles.copy()
        upright[:, row] = 0.0
        theirs = chain.mass_matrix(upright)[:, others][:, :, others]
        np.testing.assert_allclose(mass_matrices(locked.model, angles[:, others]), theirs, rtol=0.0, atol=1e-12)
