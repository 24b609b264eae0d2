"""sokolov2019 as printed: Tables I and II, its equations, and the rests that follow from (9) and (10)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cmg_mj.core.arrays import signed_power
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.papers.cube import CUBE, reduced_model

TABLE_I = {**CUBE, "l": 0.13}
"""Table I [kg, m, kg m^2, rad/s], as far as the claims need it, and the gravity that it does not give [m/s^2]."""

K_E = (35.0, 4.0, -1.0, 0.3)
"""Table II: the gains of (7), on [y1, x2, y2, x_e]."""

TABLE_II: dict[str, dict[str, Any]] = {
    "linear": {"tau": 0.02},
    "luenberger": {"L": ((20.0, 0.0), (150.0, 0.0), (0.0, 20.0))},
    "homogeneous": {"k1": 20.0, "k2": 150.0, "alpha": 0.85},
}
"""Table II: observer -> its parameters."""

OBSERVERS = {"linear": "(8)", "luenberger": "(9)", "homogeneous": "(10)"}
"""The paper's three by the bench's names, and their equations."""


def printed_model() -> ReducedModel:
    """Return J1 and J2 below (1), J_d w_d and m g l, from Table I's numbers alone."""
    return reduced_model(TABLE_I, 1)


def torques(model: ReducedModel, I_cd: float, q: np.ndarray, w: np.ndarray, dw: np.ndarray) -> np.ndarray:
    """Evaluate (1) at e = 0: the torques on frame, gimbal and wheel, (3,) [N m].

    Args:
        model: J1, J2, J_d and m g l.
        I_cd: I_c + I_d [kg m^2].
        q: q_b, q_c, q_d, (3,) [rad].
        w: Their rates, (3,) [rad/s].
        dw: Their accelerations, (3,) [rad/s^2].
    """
    J1, J2, J_d, mgl = model.J1, model.J2, model.J_d, model.gravity_torque
    (q_b, q_c, _), (w_b, w_c, w_d), (dw_b, dw_c, dw_d) = q, w, dw
    s, c, s2 = math.sin(q_c), math.cos(q_c), math.sin(2.0 * q_c)
    return np.array(
        [
            (J1 + J2 * c**2) * dw_b
            - J2 * s2 * w_c * w_b
            + J_d * dw_d * c
            - J_d * s * w_c * w_d
            - mgl * math.sin(q_b + math.pi / 4.0),
            I_cd * dw_c + J_d * w_b * w_d * s + 0.5 * J2 * s2 * w_b**2,
            J_d * dw_d + J_d * c * dw_b - J_d * s * w_c * w_b,
        ]
    )


def error_matrix(model: ReducedModel) -> np.ndarray:
    """Return A - L C of (9), (3, 3)."""
    return model.A - np.array(TABLE_II["luenberger"]["L"]) @ model.C


def rest_of_9(model: ReducedModel, e: float) -> np.ndarray:
    """Solve (A - L C) xhat + L y = 0 for the estimate of (9) at x = 0, u = 0, y1 = -e, (3,)."""
    return np.linalg.solve(error_matrix(model), -np.array(TABLE_II["luenberger"]["L"]) @ [-e, 0.0])


def rest_of_10(model: ReducedModel, e: float) -> float:
    """Return the rate of (10) at x = u = 0, y1 = -e: k1 [e_b]^alpha, k2 [e_b]^(2 alpha - 1) = f2(y) [rad/s]."""
    k1, k2, alpha = TABLE_II["homogeneous"].values()
    e_b = signed_power(float(model.terms(-e, 0.0)[0]) / k2, 1.0 / (2.0 * alpha - 1.0))
    return k1 * signed_power(e_b, alpha)
