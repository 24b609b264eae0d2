"""Checks of a linearisation: its rank, its entries against central differences, where a linear loop rests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.papers.claim import Array
from cmg_mj.papers.recorded import largest_size


def rank_margin(matrix: Array) -> float:
    """Return the least singular value by the largest: zero for a matrix without full rank."""
    values = np.linalg.svd(matrix, compute_uv=False)
    return values[-1] / values[0]


def controllability_margin(A: Array, B: Array) -> float:
    """Return the rank margin of [B, A B, ..., A^(n-1) B], for A (n, n) and B (n, m)."""
    columns = [B]
    for _ in range(len(A) - 1):
        columns.append(A @ columns[-1])
    return rank_margin(np.hstack(columns))


def mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return MuJoCo's mass matrix at a state, (nv, nv)."""
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M


def finite_difference_error(model: ReducedModel) -> float:
    """Return the error of a model's A and B against central differences of its nonlinear form, by the largest entry."""

    def f(x: Array, u: float) -> Array:
        return np.array([x[1], model.tilt_acceleration(float(x[0]), float(x[1]), float(x[2]), u), u])

    zero, h = np.zeros(3), 1e-5
    A = np.column_stack([(f(h * axis, 0.0) - f(-h * axis, 0.0)) / (2.0 * h) for axis in np.eye(3)])
    B = ((f(zero, h) - f(zero, -h)) / (2.0 * h))[:, None]
    return max(largest_size(A - model.A) / largest_size(A), largest_size(B - model.B) / largest_size(B))


def model_difference(model: ReducedModel, reference: ReducedModel) -> float:
    """Return the largest relative difference of a reduced model's constants from the printed ones."""
    names = ("J1", "J2", "J_d", "omega_d", "gravity_torque")
    return max(abs(getattr(model, name) / getattr(reference, name) - 1.0) for name in names)


def constants_of(model: ReducedModel) -> dict[str, float]:
    """Return the constants of a reduced model for a claim's figures."""
    return {
        "J1_kg_m2": model.J1,
        "J2_kg_m2": model.J2,
        "spin_momentum_n_m_s": model.J_d * model.omega_d,
        "gravity_torque_n_m": model.gravity_torque,
    }


def equilibrium(A: Array, B: Array, K: Array, e: float) -> tuple[Array, Array]:
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


def poles_as_pairs(poles: Array) -> list[list[float]]:
    """List poles, (n,), as [real part, imaginary part], which JSON can hold."""
    return [[p.real, p.imag] for p in poles]


def law_rests(model: ReducedModel, K_e: Sequence[float], static: int, integral: int) -> tuple[bool, dict[str, Any]]:
    """Solve for the rests of the static law and of the one with the integrator, by their equations' numbers.

    Returns:
        Whether both are stable, the static one resting with the gimbal at k1/k3 e alone and the other with x_e at
        k1/k4 e alone; and what was found, for a claim's figures.
    """
    K = np.array(K_e)
    rest, poles = equilibrium(model.A, model.B, K[:3], 1.0)
    rest_e, poles_e = equilibrium(model.A_e, model.B_e, K, 1.0)
    x3, x_e = K[0] / K[2], K[0] / K[3]
    miss = max(largest_size(rest - [0.0, 0.0, x3]) / abs(x3), largest_size(rest_e - [0.0, 0.0, 0.0, x_e]) / x_e)
    return miss < 1e-9 and max(np.real(poles).max(), np.real(poles_e).max()) < 0.0, {
        f"gimbal_rest_of_{static}_rad_per_rad": rest[2],
        f"integrator_rest_of_{integral}_s_per_rad": rest_e[3],
        f"poles_of_{static}_1_s": poles_as_pairs(poles),
        f"poles_of_{integral}_1_s": poles_as_pairs(poles_e),
    }
