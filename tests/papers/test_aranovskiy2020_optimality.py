"""Inverse optimality against LQR gains made here, and against the return difference frequency by frequency."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from cmg_mj.papers.aranovskiy2020.optimality import inverse_optimality
from cmg_mj.papers.aranovskiy2020.paper import K_E, printed_model

PAIR = printed_model()


def least_return_difference(K: np.ndarray) -> float:
    """min |1 + K (jw - A_e)^-1 B_e| over many frequencies."""
    w = np.logspace(-3, 5, 8000)
    pencils = 1j * w[:, None, None] * np.eye(4) - PAIR.A_e
    columns = np.linalg.solve(pencils, np.broadcast_to(PAIR.B_e, (len(w), 4, 1)))
    return float(np.abs(1.0 + columns[:, :, 0] @ K).min())


@pytest.mark.parametrize("weights", [(10.0, 1.0, 0.5, 0.1), (2000.0, 0.1, 3.0, 1.0)])
def test_a_true_lqr_gain_is_recognised_and_its_weights_found(weights: tuple[float, ...]) -> None:
    P = solve_continuous_are(PAIR.A_e, PAIR.B_e, np.diag(weights), np.eye(1))
    found = inverse_optimality(PAIR.A_e, PAIR.B_e, (PAIR.B_e.T @ P)[0])
    assert found.optimal
    np.testing.assert_allclose(found.diagonal, weights, rtol=1e-5)
    assert found.recovered < 1e-5


def test_a_stabilising_gain_that_is_no_lqrs_is_recognised() -> None:
    """Poles in the left half plane, but too little gain: the return difference dips below 1."""
    K = np.array([22.0, 2.9, -1.0, 0.3])
    assert np.linalg.eigvals(PAIR.A_e - PAIR.B_e @ K[None, :]).real.max() < 0.0
    assert least_return_difference(K) < 1.0 - 1e-6
    assert not inverse_optimality(PAIR.A_e, PAIR.B_e, K).optimal


@pytest.mark.parametrize("scale", [0.55, 0.7, 0.85, 1.0, 1.3])
def test_optimality_agrees_with_brute_force(scale: float) -> None:
    K = np.array(K_E) * [1.0, scale, 1.0, 1.0]
    assert inverse_optimality(PAIR.A_e, PAIR.B_e, K).optimal == (least_return_difference(K) >= 1.0 - 1e-9)
