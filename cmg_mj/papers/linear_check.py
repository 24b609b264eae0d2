"""Checks of a linearisation: its rank, its entries against central differences, where a linear loop rests."""

from __future__ import annotations

import numpy as np

from cmg_mj.core.reduced_model import ReducedModel


def rank_margin(matrix: np.ndarray) -> float:
    """Return the least singular value by the largest: zero for a matrix without full rank."""
    values = np.linalg.svd(matrix, compute_uv=False)
    return float(values[-1] / values[0])


def controllability_margin(A: np.ndarray, B: np.ndarray) -> float:
    """Return the rank margin of [B, A B, ..., A^(n-1) B], for A (n, n) and B (n, m)."""
    columns = [B]
    for _ in range(len(A) - 1):
        columns.append(A @ columns[-1])
    return rank_margin(np.hstack(columns))


def finite_difference_error(model: ReducedModel, h: float = 1e-5) -> float:
    """Return the error of a model's A and B against central differences of its nonlinear form, by the largest entry."""

    def f(x: np.ndarray, u: float) -> np.ndarray:
        return np.array([x[1], model.tilt_acceleration(float(x[0]), float(x[1]), float(x[2]), u), u])

    zero = np.zeros(3)
    A = np.column_stack([(f(h * axis, 0.0) - f(-h * axis, 0.0)) / (2.0 * h) for axis in np.eye(3)])
    B = ((f(zero, h) - f(zero, -h)) / (2.0 * h))[:, None]
    return float(max(np.abs(A - model.A).max() / np.abs(A).max(), np.abs(B - model.B).max() / np.abs(B).max()))


def model_difference(model: ReducedModel, reference: ReducedModel) -> float:
    """Return the largest relative difference of a reduced model's constants from the printed ones."""
    names = ("J1", "J2", "J_d", "omega_d", "gravity_torque")
    return max(abs(getattr(model, name) / getattr(reference, name) - 1.0) for name in names)


def equilibrium(A: np.ndarray, B: np.ndarray, K: np.ndarray, e: float) -> tuple[np.ndarray, np.ndarray]:
    """Solve x' = A x + B u, u = -K x + k1 e for its rest. With y1 = x1 - e the bias enters with a plus.

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, 1).
        K: Gain, (n,).
        e: The bias [rad].

    Returns:
        The state at rest, (n,), and the poles of the closed loop, (n,) [1/s].
    """
    closed = A - B @ K[None, :]
    return np.linalg.solve(closed, -B[:, 0] * K[0] * e), np.linalg.eigvals(closed)


def poles_as_pairs(poles: np.ndarray) -> list[list[float]]:
    """List poles, (n,), as [real part, imaginary part], which JSON can hold."""
    return [[float(p.real), float(p.imag)] for p in poles]
