"""The papers' observers as they are printed, integrated by scipy. No number or formula is the package's own.

Between samples the measurement runs straight and the input is held, which is what the observers assume.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.observers import Measurement, Observer, make_observer
from tests.plant import paper_model as paper

DT = 0.005

J1, J2, GRAVITY_TORQUE = paper.J1, paper.J2, paper.gravity_torque
PAPER = ReducedModel(J1, J2, paper.J_d, paper.omega_d, GRAVITY_TORQUE)
HEAVY = ReducedModel(J1=0.06, J2=0.05, J_d=2e-3, omega_d=150.0, gravity_torque=2.0)
"""A rig whose gimbal and flywheel matter, so that no term is small. In Table 1, J2 is 0.3 % of J1."""

EPSILON, BOUND = 0.0287, 10.4
"""Defaults that are not a paper's: epsilon of linear_high_gain and L of super_twisting, from `cmg-mj tune`."""

NOISE = MeasurementNoise(0.0063, 0.41, 0.89, 3.1e-4, 8.7e-5, 4e-4)
"""The noise of the bundled rig's accelerometers, 400 ug/rtHz at 200 Hz, and of its cheap gyro."""

Signal = Sequence[float] | np.ndarray

Slope = Callable[[np.ndarray, float, float, float], np.ndarray]
"""(state, y1, y2, u) -> its derivative."""


def observer(kind: str, dt: float = DT, model: ReducedModel = PAPER, **parameters: Any) -> Observer:
    return make_observer(kind, dt, model, NOISE, **parameters)


def columns(*signals: Signal | float) -> list[list]:
    """Signals of the same length, in floats, or in arrays (n_worlds,) where one has them."""
    return [s.tolist() if s.ndim == 1 else list(s) for s in np.broadcast_arrays(*signals)]


def run(
    estimator: Any,
    y1: Signal,
    y2: Signal | float = 0.0,
    u: Signal | float = 0.0,
    a: Signal | float = math.nan,
    g: Signal | float = math.nan,
) -> tuple[np.ndarray, list]:
    """Estimates after the first sample, (n - 1, 3 or more), and all n states; a and g: acceleration and gyro."""
    y1, y2, u, a, g = columns(y1, y2, u, a, g)
    states, estimates = [estimator.init(Measurement(y1[0], y2[0], a[0], g[0]))], []
    for k in range(1, len(y1)):
        state, estimate = estimator.step(states[-1], Measurement(y1[k], y2[k], a[k], g[k]), u[k - 1])
        states.append(state)
        estimates.append(estimate)
    return np.array(estimates), states


def integrate(slope: Slope, start: Signal, y1: Signal, y2: Signal, u: Signal, dt: float = DT) -> np.ndarray:
    """The continuous observer's state after each sample but the first, (n - 1, len(start))."""
    state, rows = np.array(start, dtype=float), []
    for k in range(1, len(y1)):

        def derivative(s: float, x: np.ndarray, k: int = k) -> np.ndarray:
            a, b = y1[k - 1] + s * (y1[k] - y1[k - 1]), y2[k - 1] + s * (y2[k] - y2[k - 1])
            return dt * slope(x, a, b, u[k - 1])

        state = solve_ivp(derivative, (0.0, 1.0), state, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        rows.append(state)
    return np.array(rows)


def power(x: float, exponent: float) -> float:
    """|x|^exponent sign(x)."""
    return math.copysign(abs(x) ** exponent, x)


def homogeneous_slope(m: ReducedModel = PAPER, k1: float = 20.0, k2: float = 150.0, alpha: float = 0.85) -> Slope:
    """aranovskiy2020 (11); the defaults are those of Table 2."""

    def slope(x: np.ndarray, y1: float, y2: float, u: float) -> np.ndarray:
        e = x[0] - y1
        gyroscopic = u * (m.J_d * m.omega_d * math.cos(y2) - m.J2 * x[1] * math.sin(2.0 * y2))
        f2 = (gyroscopic + m.gravity_torque * math.sin(y1)) / (m.J1 + m.J2 * math.sin(y2) ** 2)
        return np.array([x[1] - k1 * power(e, alpha), f2 - k2 * power(e, 2.0 * alpha - 1.0)])

    return slope


def ltv_slope(m: ReducedModel = PAPER, Q: Sequence[float] = (1.0, 5e6, 1.0)) -> Slope:
    """aranovskiy2020 (10) with the corrected Riccati equation, all nine entries of H after the three of x."""
    C = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

    def slope(z: np.ndarray, y1: float, y2: float, u: float) -> np.ndarray:
        x, H = z[:3], z[3:].reshape(3, 3)
        D = m.J1 + m.J2 * math.sin(y2) ** 2
        A = np.array([[0.0, 1.0, 0.0], [0.0, -u * m.J2 * math.sin(2.0 * y2) / D, 0.0], [0.0, 0.0, 0.0]])
        b = np.array([0.0, (u * m.J_d * m.omega_d * math.cos(y2) + m.gravity_torque * math.sin(y1)) / D, u])
        HC = H @ C.T
        dH = H @ A.T + A @ H - HC @ HC.T + np.diag(Q)
        return np.concatenate([A @ x + b - HC @ (C @ x - np.array([y1, y2])), dH.ravel()])

    return slope


def luenberger_slope(L: Sequence[Sequence[float]], m: ReducedModel = PAPER) -> Slope:
    """sokolov2019 (9) with (5)."""

    def slope(x: np.ndarray, y1: float, y2: float, u: float) -> np.ndarray:
        e1, e2 = y1 - x[0], y2 - x[2]
        return np.array(
            [
                x[1] + L[0][0] * e1 + L[0][1] * e2,
                m.gravity_torque / m.J1 * x[0] + m.J_d * m.omega_d / m.J1 * u + L[1][0] * e1 + L[1][1] * e2,
                u + L[2][0] * e1 + L[2][1] * e2,
            ]
        )

    return slope


def rough_signals(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """y1, y2, u of a restless rig: a swinging, noisy tilt, a wandering gimbal, a command up to its limit."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * DT
    y1 = 0.05 * np.sin(9.0 * t) + rng.normal(0.0, 2e-3, n)
    u = np.clip(rng.normal(0.0, 4.0, n), -4.7, 4.7)
    return y1, 0.3 + DT * np.cumsum(u), u
