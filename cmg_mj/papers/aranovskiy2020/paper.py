"""aranovskiy2020 as printed: Tables 1 and 2, the reduced model, where the law rests, the observer (10)."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.papers.claim import Array
from cmg_mj.papers.cube import CUBE, reduced_model

TABLE_1 = {**CUBE, "l": 0.19}
"""Table 1 [kg, m, kg m^2, rad/s], and the standard gravity that it does not give [m/s^2]."""

K_E = (35.0, 4.0, -1.0, 0.3)
"""Table 2: the gains of (8) on [x1, x2, x3, x_e]; the first three of them in (7)."""

K_E_ROUNDING = (0.5, 0.5, 0.5, 0.05)
"""Half a unit of the last digit that each of them is printed with."""

TABLE_2: dict[str, dict[str, Any]] = {
    "linear": {"tau": 0.02},
    "ltv": {"Q": (1.0, 5e6, 1.0), "H0": (1.0, 1.0, 1.0)},
    "homogeneous": {"k1": 20.0, "k2": 150.0, "alpha": 0.85},
}
"""Table 2: observer -> its parameters."""

OBSERVERS = {"linear": "(9)", "ltv": "(10)", "homogeneous": "(11)"}
"""The paper's three by the bench's names, and their equations."""

Q, H_0 = np.diag(TABLE_2["ltv"]["Q"]), np.diag(TABLE_2["ltv"]["H0"])
"""Q and H(0) of (10), (3, 3)."""

C = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""After (10): tilt and gimbal angle are measured."""


@cache
def printed_model() -> ReducedModel:
    """Return J1, J2, J_d omega_d and m g l/sqrt(2) by the closed forms below (2), from Table 1's numbers alone."""
    return reduced_model(TABLE_1, 2)


def gimbal_torque(x2: float, x3: float, gimbal_acceleration: float, omega_d: float) -> float:
    """Return tau_c, the second line of (2), with q_c = x3 + pi/2 [N m].

    Args:
        x2: omega_b [rad/s].
        x3: Gimbal angle from upright [rad].
        gimbal_acceleration: omega_c' [rad/s^2].
        omega_d: The flywheel's speed [rad/s].

    Returns:
        The torque on one gimbal.
    """
    q_c = x3 + math.pi / 2.0
    inertial_torque = (TABLE_1["I_c"] + TABLE_1["I_d"]) * gimbal_acceleration
    tilt_torque = 0.5 * printed_model().J2 * math.sin(2.0 * q_c) * x2**2
    return inertial_torque + TABLE_1["J_d"] * x2 * omega_d * math.sin(q_c) + tilt_torque


def damping(u: float | Array, y2: float | Array) -> float | Array:
    """Return a = -u J2 sin(2 y2)/(J1 + J2 sin(y2)^2), the one entry of A' in (10) that varies [1/s]."""
    return -u * printed_model().terms(0.0, y2)[2]


def A_prime(a: float = 0.0) -> Array:
    """A'(y, u) of (10), by its entry a [1/s]; at rest, where a = 0, a double integrator. (3, 3)."""
    return np.array([[0.0, 1.0, 0.0], [0.0, a, 0.0], [0.0, 0.0, 0.0]])


def riccati_slope(H: Array, A: Array, first: Array | None = None) -> Array:
    """H' of (10): H A'^T + A' H - H C^T C H + Q, in the precision of H, (3, 3).

    Args:
        H: The gain matrix, (3, 3).
        A: A', (3, 3).
        first: Matrix that stands transposed in the first term instead: A of (6) is printed there. (3, 3).

    Returns:
        The slope.
    """
    A, first, lost, gained = (matrix.astype(H.dtype) for matrix in (A, A if first is None else first, C.T @ C, Q))
    return H @ first.T + A @ H - H @ lost @ H + gained


def settled_gains() -> tuple[float, float]:
    """H11 and H12 at which the Riccati equation of (10) settles at rest, Q of Table 2 [1/s], [1/s^2]."""
    q1, q2 = Q[0, 0], Q[1, 1]
    return math.sqrt(q1 + 2.0 * math.sqrt(q2)), math.sqrt(q2)
