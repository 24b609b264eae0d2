"""The time-varying observer against aranovskiy2020 (10), its Riccati equation above all (Remark 1 there)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from tests.observers.reference import HEAVY, PAPER, integrate, ltv_slope, observer, rough_signals, run

C = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def riccati_matrix(state) -> np.ndarray:
    """H, (3, 3)."""
    return np.array([[state.h11, state.h12, 0.0], [state.h12, state.h22, 0.0], [0.0, 0.0, state.h33]], dtype=float)


def relative_errors(package_step: np.ndarray, reference: np.ndarray) -> float:
    """Largest relative error of the entries that are not zero by structure."""
    mask = np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], dtype=bool)
    return float(np.abs(package_step[..., mask] / reference[..., mask] - 1.0).max())


CASES = [
    pytest.param({}, PAPER, id="Table 2"),
    pytest.param({"Q": (300.0, 2e4, 900.0)}, PAPER, id="Q"),
    pytest.param({"H0": (40.0, 3e4, 0.1)}, PAPER, id="H0"),
    pytest.param({"Q": (1.0, 100.0, 1.0)}, HEAVY, id="another rig"),
]


@pytest.mark.parametrize(("parameters", "model"), CASES)
def test_follows_the_continuous_observer(parameters: dict, model) -> None:
    y1, y2, u = rough_signals(100)
    start = np.concatenate([[y1[0], 0.0, y2[0]], np.diag(parameters.get("H0", (1.0, 1.0, 1.0))).ravel()])
    reference = integrate(ltv_slope(model, parameters.get("Q", (1.0, 5e6, 1.0))), start, y1, y2, u)
    estimates, states = run(observer("ltv", model=model, **parameters), y1, y2, u)
    error = relative_errors(np.array([riccati_matrix(s) for s in states[1:]]), reference[:, 3:].reshape(-1, 3, 3))
    relative_error = np.abs(estimates - reference[:, :3]).max(axis=0) / np.abs(reference[:, :3]).max(axis=0)
    assert error < (2e-4 if model is HEAVY else 1e-6)
    np.testing.assert_array_less(relative_error, 1e-4)


EXTREMES = [
    pytest.param(dt, (q1, q2, q3), steps, id=f"{dt:g} s, Q = {q1:g}, {q2:g}, {q3:g}")
    for dt in (0.001, 0.05)
    for q1, q2, q3, steps in (
        (1.0, 5e6, 1.0, 100),
        (1e-3, 1e12, 1e6, 25),
        (1e6, 1e-3, 1.0, 25),
    )
] + [pytest.param(0.001, (1e12, 1e12, 1.0), 3, id="0.001 s, Q = 1e+12, 1e+12, 1")]


@pytest.mark.parametrize(("dt", "weights", "steps"), EXTREMES)
def test_riccati_matrix_stays_positive_definite(dt: float, weights: tuple[float, float, float], steps: int) -> None:
    """Step after step on the rig where A' varies most, from small and large H0. By minors: H may be as ill
    conditioned as 1e16, where eigenvalues are lost in rounding."""
    y1, y2, u = rough_signals(steps)
    for h0 in (1e-3, 1e6):
        _, states = run(observer("ltv", dt, HEAVY, Q=weights, H0=(h0, h0, h0)), y1, y2, u)
        for state in states:
            assert np.isfinite(riccati_matrix(state)).all()
            assert state.h11 > 0.0
            assert state.h22 > 0.0
            assert state.h11 * state.h22 > state.h12**2
            assert state.h33 > 0.0


@pytest.mark.daily_cases("0.005-weights0", "0.005-weights1", "0.05-weights2")
@pytest.mark.parametrize(
    ("dt", "weights"),
    [(0.005, (1.0, 1e9, 1.0)), (0.005, (1e4, 1e9, 1e4)), (0.05, (1.0, 5e6, 1.0)), (0.05, (100.0, 1e6, 9.0))],
)
def test_riccati_matrix_settles_where_it_should(dt: float, weights: tuple[float, float, float]) -> None:
    """At rest: H12 = sqrt(Q2), H11 = sqrt(Q1 + 2 H12), H22 = H11 H12, H33 = sqrt(Q3)."""
    n = 2000
    _, states = run(observer("ltv", dt, Q=weights), [0.0] * n)
    h12 = math.sqrt(weights[1])
    h11 = math.sqrt(weights[0] + 2.0 * h12)
    expected = [[h11, h12, 0.0], [h12, h11 * h12, 0.0], [0.0, 0.0, math.sqrt(weights[2])]]
    np.testing.assert_allclose(riccati_matrix(states[-1]), expected, rtol=1e-8)


@pytest.mark.parametrize("dt", [0.001, 0.05])
@pytest.mark.parametrize("weights", [(400.0, 1e4, 1.0), (1.0, 5e6, 100.0)])
def test_riccati_matrix_is_exact_while_the_gimbal_stands(dt: float, weights: tuple[float, float, float]) -> None:
    """A' is constant then, of up to -4 1/s on this rig, and scipy's exponential of the Hamiltonian exact."""
    n, y2, u = 12, 0.7, 4.7
    _, states = run(observer("ltv", dt, HEAVY, Q=weights), [0.01] * n, y2, u)
    damping = u * HEAVY.J2 * math.sin(2.0 * y2) / (HEAVY.J1 + HEAVY.J2 * math.sin(y2) ** 2)
    A = np.array([[0.0, 1.0, 0.0], [0.0, -damping, 0.0], [0.0, 0.0, 0.0]])
    E, H = expm(dt * np.block([[-A.T, C.T @ C], [np.diag(weights), A]])), np.eye(3)
    for state in states[1:]:
        H = (E[3:, :3] + E[3:, 3:] @ H) @ np.linalg.inv(E[:3, :3] + E[:3, 3:] @ H)
        assert relative_errors(riccati_matrix(state), H) < 1e-8
