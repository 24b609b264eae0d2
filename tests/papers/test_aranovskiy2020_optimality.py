"""Inverse optimality against LQR gains made here, and against the return difference frequency by frequency."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from cmg_mj.laws.state_feedback import lqr_gains
from cmg_mj.papers.aranovskiy2020 import gains
from cmg_mj.papers.aranovskiy2020.gains import inverse_optimality, nearest_diagonal
from cmg_mj.papers.aranovskiy2020.paper import K_E, K_E_ROUNDING, printed_model

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
    _, diagonal, _, recovered = inverse_optimality(PAIR.A_e, PAIR.B_e, (PAIR.B_e.T @ P)[0])
    assert recovered is not None
    np.testing.assert_allclose(diagonal, weights, rtol=1e-5)
    assert recovered < 1e-5


@pytest.mark.parametrize("scale", [0.4, 0.55, 0.7, 0.85, 1.0, 1.3])
def test_optimality_agrees_with_brute_force(scale: float) -> None:
    K = np.array(K_E) * [1.0, scale, 1.0, 1.0]
    assert (inverse_optimality(PAIR.A_e, PAIR.B_e, K)[2] is not None) == (least_return_difference(K) >= 1.0 - 1e-9)


def test_a_diagonal_cost_gives_the_printed_gains_to_their_digits() -> None:
    """By python-control, which the search does not use; rounded as they are printed."""
    claim = gains.lqr_gains()
    assert claim.verdict == "reproduced"
    gain = lqr_gains(PAIR, claim.figures["diagonal_within_rounding"], 1.0)
    assert [round(k) for k in gain[:3]] + [round(gain[3], 1)] == list(K_E)


def test_a_search_that_starts_far_off_comes_near() -> None:
    weights = np.array([900.0, 3.0, 0.8, 0.2])
    K = gains.lqr_gain(PAIR.A_e, PAIR.B_e, np.diag(weights))
    assert nearest_diagonal(PAIR.A_e, PAIR.B_e, K, K_E_ROUNDING, 1.5 * weights)[1] < 0.1
