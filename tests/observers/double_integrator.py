"""A double integrator with two accelerometers: its motion, what they show, and the best fit to all of that."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.observers.free_pivot import FreePivot
from cmg_mj.observers.gyro_free import GyroFree
from tests.observers.reference import DT, NOISE

C = NOISE.correlation * NOISE.tilt / NOISE.acceleration
"""v = C n + what is independent of n."""
INDEPENDENT = NOISE.tilt * math.sqrt(1.0 - NOISE.correlation**2)


def motion(n: int, rng: np.random.Generator, bias: float, rate: float = 0.0) -> tuple[np.ndarray, ...]:
    """x1, x2 and alpha, which runs straight between samples, and what the sensors show of it: y1 and a."""
    alpha = 3.0 * np.sin(np.arange(n) * 0.11) + rng.normal(0.0, 0.5, n)
    x2 = rate + np.concatenate([[0.0], np.cumsum(0.5 * DT * (alpha[1:] + alpha[:-1]))])
    x1 = 0.02 + np.concatenate([[0.0], np.cumsum(DT * x2[:-1] + DT**2 * (alpha[:-1] / 3.0 + alpha[1:] / 6.0))])
    noise = rng.normal(0.0, NOISE.acceleration, n)
    other = rng.normal(0.0, INDEPENDENT, n)
    return x1, x2, alpha, x1 + C * noise + other, alpha + bias + noise


def shares_of_y1(n: int, sigma: float, hz: float, rng: np.random.Generator) -> np.ndarray:
    """Make the part of y1 that a moving pivot adds: first-order noise."""
    f, w = math.exp(-2.0 * math.pi * hz * DT), [rng.normal(0.0, sigma)]
    for _ in range(n - 1):
        w.append(f * w[-1] + rng.normal(0.0, sigma * math.sqrt(1.0 - f * f)))
    return np.array(w)


def least_squares(estimator: GyroFree | FreePivot, y1: np.ndarray, a: np.ndarray) -> np.ndarray:
    """x1, x2 and w at the last sample that fit all samples and the start best, weighed by their standard deviations.

    Unknown are x1 and x2 at the first sample, b, every sample's n and, of a pivot that moves, its w; bias_walk and jerk
    are zero.
    """
    n = len(y1)
    unknown = 3 + (2 if isinstance(estimator, FreePivot) else 1) * n
    x1, x2, start = integrator_rows(y1, a, unknown, DT, estimator.rate_start, estimator.bias_start)
    noise, w = np.eye(n, unknown + 1, 3), np.zeros((n, unknown + 1))
    rows = [noise / NOISE.acceleration, start]
    if isinstance(estimator, FreePivot):
        w = np.eye(n, unknown + 1, 3 + n)
        f, sigma = math.exp(-2.0 * math.pi * estimator.pivot_hz * DT), estimator.pivot_start
        rows += [w[:1] / sigma, (w[1:] - f * w[:-1]) / (sigma * math.sqrt(1.0 - f * f))]
    reading = x1 + w + C * noise
    reading[:, -1] -= y1
    system = np.vstack([reading / INDEPENDENT, *rows])
    solution = np.append(np.linalg.lstsq(system[:, :-1], -system[:, -1], rcond=None)[0], 1.0)
    return np.array([x1[-1], x2[-1], w[-1]]) @ solution


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
