"""The extended Kalman filter against one of NumPy's matrices, against its own steady state, and against its promise."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad_vec, solve_ivp
from scipy.linalg import expm, solve_discrete_are

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import Measurement
from cmg_mj.observers.kalman import PAIRS, Covariance, Kalman
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.observers.reference import DT, HEAVY, PAPER, observer, rough_signals, run

C = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
PAIR = dataclasses.replace(PAPER, gimbals=2)

DEFAULTS: Any = {
    "torque_walk": 0.03,
    "torque_white": 0.082,
    "gimbal_white": 0.024,
    "rate_start": 0.1,
    "torque_start": 0.2,
}


def kalman(model: ReducedModel = PAIR, **parameters: float) -> Kalman:
    estimator = observer("kalman", model=model, **parameters)
    assert isinstance(estimator, Kalman)
    return estimator


def slope(estimator: Kalman, x: np.ndarray, u: float) -> np.ndarray:
    """x' of the state (x1, x2, x3, torque) without noise: (4), the torque shared by the gimbals."""
    m, (x1, x2, x3, torque) = estimator.model, x
    D = m.J1 + m.J2 * math.sin(x3) ** 2
    gyroscopic = u * (m.J_d * m.omega_d * math.cos(x3) - m.J2 * x2 * math.sin(2.0 * x3))
    f2 = (gyroscopic + m.gravity_torque * math.sin(x1) + torque / m.gimbals) / D
    return np.array([x2, f2, u, 0.0])


def jacobian(estimator: Kalman, x: np.ndarray, u: float) -> np.ndarray:
    """By central differences, (4, 4)."""
    steps = 1e-5 * np.eye(4)
    return np.array([(slope(estimator, x + d, u) - slope(estimator, x - d, u)) / 2e-5 for d in steps]).T


def sample_noise(estimator: Kalman, A: np.ndarray) -> np.ndarray:
    """The covariance that a sample period adds, by quadrature, (4, 4)."""
    m = estimator.model
    per_torque, gyroscopic = 1.0 / (m.gimbals * m.J1), m.J_d * m.omega_d / m.J1
    input_matrix = np.zeros((4, 3))
    input_matrix[3, 0], input_matrix[1, 1] = estimator.torque_walk, per_torque * estimator.torque_white
    input_matrix[1:3, 2] = gyroscopic * estimator.gimbal_white, estimator.gimbal_white

    def integrand(s: float) -> np.ndarray:
        response = expm(A * s) @ input_matrix
        return response @ response.T

    return quad_vec(integrand, 0.0, estimator.dt, epsabs=1e-16)[0]


def measured_noise(estimator: Kalman) -> np.ndarray:
    """Covariance of (y1, y2), (2, 2)."""
    return np.diag([estimator.noise.tilt**2, estimator.noise.gimbal**2])


def matrix(P: Covariance) -> np.ndarray:
    """All sixteen entries, (4, 4)."""
    full = np.zeros((4, 4))
    for (i, j), entry in zip(PAIRS, P, strict=True):
        full[i, j] = full[j, i] = entry
    return full


def reference(estimator: Kalman, y1: np.ndarray, y2: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The textbook's extended Kalman filter: estimates (n - 1, 4), and the last covariance (4, 4)."""
    R = measured_noise(estimator)
    Q = sample_noise(estimator, jacobian(estimator, np.zeros(4), 0.0))
    x = np.array([y1[0], 0.0, y2[0], 0.0])
    P = np.diag([R[0, 0], estimator.rate_start**2, R[1, 1], estimator.torque_start**2])
    estimates = []
    for k in range(1, len(y1)):
        command = float(u[k - 1])
        F = expm(jacobian(estimator, x, command) * estimator.dt)
        x = solve_ivp(
            lambda t, x, command=command: slope(estimator, x, command), (0.0, estimator.dt), x, rtol=1e-11, atol=1e-12
        ).y[:, -1]
        P = F @ P @ F.T + Q
        K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
        x = x + K @ (np.array([y1[k], y2[k]]) - C @ x)
        P = (np.eye(4) - K @ C) @ P @ (np.eye(4) - K @ C).T + K @ R @ K.T
        estimates.append(x)
    return np.array(estimates), P


@pytest.mark.parametrize("model", [PAIR, HEAVY], ids=["pair", "heavy"])
def test_equals_the_textbooks_filter(model: ReducedModel) -> None:
    """But for the third order of a step with the command at its limit: 2 % of the estimate's own noise."""
    estimator = kalman(model)
    signals = rough_signals(200, seed=1)
    expected, P = reference(estimator, *signals)
    estimates, states = run(estimator, *signals)
    off = np.abs(estimates - expected).max(axis=0)
    assert (off < [2e-6, 2e-4, 1e-9, 1e-4]).all(), off
    np.testing.assert_allclose(matrix(states[-1].P), P, rtol=2e-3, atol=1e-10)


def test_defaults() -> None:
    assert kalman() == kalman(**DEFAULTS)


@pytest.mark.parametrize(("pole_dt", "most"), [(0.05, 4e-12), (0.0374, 6e-13)])
def test_the_series_ends_where_it_says(pole_dt: float, most: float) -> None:
    """Against the closed forms with b = 0: phi = sinh(p dt)/p, psi = (cosh(p dt) - 1)/p^2."""
    dt, phi, psi, _ = kalman()._integrals((pole_dt / DT) ** 2, 0.0)
    exact = math.sinh(pole_dt) / pole_dt * dt, 2.0 * (math.sinh(pole_dt / 2.0) / pole_dt * dt) ** 2
    assert 0.5 * most < 1.0 - phi / exact[0] < most
    assert 0.0 < 1.0 - psi / exact[1] < most


def test_settles_at_the_linear_filter() -> None:
    """About the upright the gains become those of the algebraic Riccati equation."""
    estimator = kalman()
    A, R = jacobian(estimator, np.zeros(4), 0.0), measured_noise(estimator)
    P = solve_discrete_are(expm(A * DT).T, C.T, sample_noise(estimator, A), R)
    covariance = P - P @ C.T @ np.linalg.solve(C @ P @ C.T + R, C @ P)
    state = run(estimator, np.zeros(8000))[1][-1]
    np.testing.assert_allclose(matrix(state.P), covariance, rtol=1e-6, atol=1e-14)
    gain = covariance @ C.T @ np.linalg.inv(R)
    for column, y in ((0, Measurement(1e-9, 0.0)), (1, Measurement(0.0, 1e-9))):
        estimate = np.array(estimator.step(state, y, 0.0)[1])
        np.testing.assert_allclose(estimate, gain[:, column] * 1e-9, rtol=1e-5, atol=1e-16)


@pytest.mark.daily_cases("0.005")
@pytest.mark.parametrize("dt", [0.001, 0.005, 0.02])
def test_covariance_stays_a_covariance(dt: float) -> None:
    """Over 20,000 samples of signals that no rig makes, from a start that knows next to nothing."""
    estimator = kalman(dt=dt, rate_start=100.0, torque_start=100.0)
    _, states = run(estimator, *rough_signals(20_000, seed=2))
    for state in (*states[1:100], *states[100::100]):
        P = matrix(state.P)
        scale = np.sqrt(np.diag(P))
        assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > 1e-6


def test_a_bias_is_found_as_a_torque() -> None:
    """At rest at y1 = -e gravity pulls as if upright: the torque that e makes is n M sin e."""
    estimator = kalman()
    e = math.radians(1.0)
    estimates, _ = run(estimator, [-e] * 3000)
    expected = (0.0 - e, 0.0, 0.0, PAIR.gimbals * PAIR.gravity_torque * math.sin(e))
    np.testing.assert_allclose(estimates[-1], expected, atol=1e-4)
    assert "bias_rad" not in estimator.extra_signals


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("push_recovery", []),
        ("push_recovery", ["sensors.encoder.counts_per_revolution=1024"]),
        ("push_recovery", ["plant.gimbal_friction_n_m=0.1", "plant.gimbal_backlash_arcmin=10"]),
        ("single_gimbal", []),
    ],
)
def test_the_noise_of_y2_is_that_of_a_run(scenario: str, settings: list[str]) -> None:
    """Both encoders of a pair round alike, so that y2 is no better than one of them."""
    experiment = prepare(load_scenario(scenario, ["duration_s=3", *settings], "kalman"))
    observer: Any = experiment.design.observer()
    seen = experiment.run_many(16).trajectory
    assert seen is not None
    assert (seen["y2_rad"] - seen["x3_rad"]).std() == pytest.approx(observer.noise.gimbal, rel=0.03)
