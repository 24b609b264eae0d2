"""Exact discretisation of linear dynamics between samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar

Coefficients = tuple[list[float], list[float]]


class FilterState(NamedTuple):
    """State of a second-order filter of the tilt, and the last measured tilt."""

    z1: Scalar
    z2: Scalar
    y1: Scalar


def hold_matrices(A: np.ndarray, B: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Discretise x' = A x + B w exactly for inputs that are held or that run straight between samples.

    With w_k = w(t_k): x_k = Phi x_{k-1} + Gamma_hold w_{k-1} + Gamma_ramp (w_k - w_{k-1}); without the last
    term for an input held since k-1. (Van Loan's augmented exponential; both holds from one matrix.)

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, m).
        dt: Sample period [s].

    Returns:
        Phi (n, n), Gamma_hold (n, m), Gamma_ramp (n, m).
    """
    from scipy.linalg import expm

    n, m = B.shape
    augmented = np.zeros((n + 2 * m, n + 2 * m))
    augmented[:n, :n] = A * dt
    augmented[:n, n : n + m] = B * dt
    augmented[n : n + m, n + m :] = np.eye(m)
    exponential = expm(augmented)
    return exponential[:n, :n], exponential[:n, n : n + m], exponential[:n, n + m :]


def second_order_rows(A: np.ndarray, B: np.ndarray, dt: float) -> Coefficients:
    """Exact step of z' = A z + B y for a y that runs straight between samples.

    Args:
        A: State matrix, (2, 2).
        B: Input matrix, (2, 1).
        dt: Sample period [s].

    Returns:
        For each of z1, z2 its coefficients of (z1, z2, y_{k-1}, y_k).
    """
    Phi, hold, ramp = hold_matrices(A, B, dt)
    row1, row2 = np.hstack([Phi, hold - ramp, ramp]).tolist()
    return row1, row2


def second_order_step(rows: Coefficients, state: FilterState, y1: Scalar) -> FilterState:
    """Advance a second-order filter by one sample."""
    (a, b, c, d), (e, f, g, h) = rows
    z1, z2, last = state
    return FilterState(a * z1 + b * z2 + c * last + d * y1, e * z1 + f * z2 + g * last + h * y1, y1)
