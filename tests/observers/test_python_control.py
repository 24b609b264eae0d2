"""The reduced model handed to python-control is the reduced model."""

# python-control has no types, and those pyright infers are wrong.
# pyright: reportArgumentType=false

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from control import input_output_response, linearize
from scipy.integrate import solve_ivp

from cmg_mj.core.reduced_model import ReducedModel
from tests.observers.reference import HEAVY, PAPER

MODELS = pytest.mark.parametrize("model", [PAPER, HEAVY, dataclasses.replace(HEAVY, gimbals=2)])


@MODELS
def test_linear_system_has_the_models_matrices(model: ReducedModel) -> None:
    system: Any = model.linear_system()
    for matrix, expected in ((system.A, model.A), (system.B, model.B), (system.C, model.C)):
        np.testing.assert_array_equal(matrix, expected)
    np.testing.assert_array_equal(system.D, np.zeros((2, 1)))
    assert (system.input_labels, system.output_labels) == (["u"], ["y1", "y2"])
    assert system.state_labels == ["x1", "x2", "x3"]
    assert system.isctime()


@MODELS
def test_linearisation_of_the_nonlinear_system_is_the_linear_one(model: ReducedModel) -> None:
    linear: Any = linearize(model.nonlinear_system(), [0.0, 0.0, 0.0], [0.0])
    for matrix, expected in ((linear.A, model.A), (linear.B, model.B), (linear.C, model.C)):
        np.testing.assert_allclose(matrix, expected, atol=1e-4)  # one-sided differences of 1e-6


def test_simulated_response_of_the_nonlinear_system() -> None:
    """Against the equation as it is printed, integrated by scipy, under a turning gimbal."""
    times = np.linspace(0.0, 0.5, 101)
    inputs = 2.0 * np.sin(9.0 * times)

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        u = np.interp(t, times, inputs)
        momentum = HEAVY.J_d * HEAVY.omega_d * np.cos(x[2]) - HEAVY.J2 * np.sin(2.0 * x[2]) * x[1]
        torque = HEAVY.gravity_torque * np.sin(x[0]) + u * momentum
        return np.array([x[1], torque / (HEAVY.J1 + HEAVY.J2 * np.sin(x[2]) ** 2), u])

    start = np.array([0.05, -0.3, 0.4])
    tight: Any = {"rtol": 1e-9, "atol": 1e-11, "max_step": 0.005}  # no step across a corner of the input
    expected = solve_ivp(slope, (0.0, times[-1]), start, t_eval=times, **tight).y
    response: Any = input_output_response(HEAVY.nonlinear_system(), times, inputs, start, solve_ivp_kwargs=tight)
    np.testing.assert_allclose(response.states, expected, atol=1e-5)
    np.testing.assert_allclose(response.outputs, expected[[0, 2]], atol=1e-5)
    assert np.abs(expected).max(axis=1).min() > 0.5  # far from where the linear model would do
