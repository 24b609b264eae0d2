"""Tilt and rate of a double integrator as linear combinations of what is unknown."""

from __future__ import annotations

import numpy as np


def integrator_rows(
    y1: np.ndarray, a: np.ndarray, unknown: int, dt: float, rate_start: float, bias_start: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Write x1 and x2 at each sample as rows: coefficients of the unknowns, then what is known. So what fits the start.

    The unknowns are x1 and x2 at the first sample, b, every sample's n, and any number more. The angular acceleration
    a - b - n goes linearly from sample to sample.

    Args:
        y1: Measured tilt, (n,) [rad].
        a: Measured angular acceleration, (n,) [rad/s^2].
        unknown: Number of unknowns.
        dt: Sample period [s].
        rate_start: Standard deviation of the rate at the start [rad/s].
        bias_start: That of b [rad/s^2].

    Returns:
        The rows of x1 [rad] and of x2 [rad/s], (n, unknown + 1) each; those of the start's misfit, (3, unknown + 1).
    """
    n = len(a)
    alpha = np.zeros((n, unknown + 1))
    alpha[:, 2], alpha[:, -1] = -1.0, a
    alpha[np.arange(n), 3 + np.arange(n)] = -1.0
    x1, x2 = np.zeros((n, unknown + 1)), np.zeros((n, unknown + 1))
    x1[0, 0] = x2[0, 1] = 1.0
    for k in range(1, n):
        x2[k] = x2[k - 1] + 0.5 * dt * (alpha[k - 1] + alpha[k])
        x1[k] = x1[k - 1] + dt * x2[k - 1] + dt**2 * (alpha[k - 1] / 3.0 + alpha[k] / 6.0)
    start_p = x1[:1] - dt**2 / 6.0 * alpha[:1]
    start_p[:, -1] -= y1[0] - dt**2 / 6.0 * a[0]
    start_z = (x2[:1] - 0.5 * dt * alpha[:1]) / rate_start
    start_b = np.eye(1, unknown + 1, 2) / bias_start
    return x1, x2, np.vstack([start_p, start_z, start_b])
