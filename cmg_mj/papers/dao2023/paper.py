"""dao2023 as printed: its example, the pendulum robot of section 3, and the gains of its observers."""

from __future__ import annotations

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.papers.dao2023.observer import Array, System

# Section 3.2, the arm.
MASS, LENGTH, INERTIA, GRAVITY = 1.0, 1.0, 0.5, 9.81  # kg, m, kg m^2, m/s^2
OMEGA = 3.0
"""Angular frequency of the disturbance [rad/s]."""
THETA = np.array([MASS * GRAVITY * LENGTH / (2.0 * INERTIA), 1.0 / INERTIA])
"""theta1 [1/s^2], theta2 [1/(kg m^2)]: (9.81, 2); section 3.1."""

A_M = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -OMEGA], [0.0, 0.0, OMEGA, 0.0]])
C_M = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""The exosystem (3), (4) of (theta1, theta2, d), section 3.1."""

# Section 3.2, the observers.
L = -np.array([[1.0], [1.0]])
L_PRINTED = -np.array([[1.0, 1.0]])
"""A row, which does not fit: with one output L has one column."""
GAMMA = np.diag([2.0, 2.0, 1.0, 1.0])
SIGMAS = (10.0, 1000.0, 0.1)
"""Weights of Fig. 3(a), (b), (c); the first is that of Fig. 2, too."""


def torque(t: Scalar) -> Scalar:
    """Return the arm's torque u(t), section 3.2 [N m]."""
    return 5.0 * (np.sin(2.0 * t) + np.cos(20.0 * t))


def disturbance(t: Scalar) -> Scalar:
    """Return d(t) as (14) has it, an acceleration [rad/s^2]."""
    return np.sin(OMEGA * t)


def acceleration(q: Scalar, t: float, coefficient: float = 1.0) -> Scalar:
    """Return the arm's q'', (14); with theta2 for the coefficient of d it is that of (10).

    Args:
        q: Angle of the arm, (...,) [rad].
        t: Time [s].
        coefficient: Factor of d.

    Returns:
        The acceleration, (...,) [rad/s^2].
    """
    return THETA[1] * torque(t) + coefficient * disturbance(t) - THETA[0] * np.sin(q)


def exosystem_state(t: Scalar) -> Array:
    """Return the true xm(t), (..., 4): theta1, theta2 and the two states of the sinusoid."""
    t = np.asarray(t)
    constant = np.broadcast_to(THETA, (*t.shape, 2))
    return np.concatenate([constant, np.cos(OMEGA * t)[..., None], np.sin(OMEGA * t)[..., None]], axis=-1)


def system(q: Scalar, u: Scalar) -> System:
    """Return the matrices of (14), (15) at a measured angle and a torque, r being (theta1, theta2, d).

    Args:
        q: Angle of the arm, (...,) [rad].
        u: Torque, (...,) [N m].

    Returns:
        The matrices; B0 has the leading dimensions of q.
    """
    q, u = np.broadcast_arrays(q, u)
    B0 = np.zeros((*q.shape, 2, 3))
    B0[..., 1, :] = np.stack([-np.sin(q), u, np.ones_like(q)], axis=-1)
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    return System(A, B0, np.zeros((2, 1)), np.array([[1.0, 0.0]]), np.zeros((1, 3)))


def error_matrix() -> Array:
    """Return A + L C2, (2, 2)."""
    matrices = system(0.0, 0.0)
    return matrices.A + L @ matrices.C2
