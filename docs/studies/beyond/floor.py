"""The floor of the velocity error from y1: the filter that knows all else, but takes no rate from the gimbals."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from cmg_mj.core.reduced_model import ReducedModel


def kalman_filter(model: ReducedModel, dt: float, sigma: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the stationary Kalman filter of the linearised rig with every torque on it known, and its error.

    Knowing the gimbals' motion, the push and e exactly, the error obeys x' = [[0, 1], [M/J1, 0]] x without any process
    noise: only the measurement's noise is left. The rig being unstable, the error does not die out even so. In
    continuous time, with R the noise's density and l the unstable pole, its variance is 2 l R [[1, l], [l, l^2]].

    Args:
        model: The reduced model.
        dt: Sample period [s].
        sigma: Standard deviation of y1's noise [rad].

    Returns:
        Phi, (2, 2); the filter's gain, (2,); the covariance of the error after each measurement, (2, 2).
    """
    Phi = expm(np.array([[0.0, 1.0], [model.gravity_torque / model.J1, 0.0]]) * dt)
    C, R = np.array([[1.0, 0.0]]), np.array([[sigma**2]])
    prior = solve_discrete_are(Phi.T, C.T, np.zeros((2, 2)), R)
    gain = prior @ C.T / (C @ prior @ C.T + R)
    return Phi, gain[:, 0], prior - gain @ C @ prior


def velocity_floor(model: ReducedModel, dt: float, sigma: float) -> float:
    """Return the RMS velocity error of that filter [rad/s]; no unbiased estimate from y1 is better."""
    return math.sqrt(kalman_filter(model, dt, sigma)[2][1, 1])
