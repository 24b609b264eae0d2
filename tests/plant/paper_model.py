"""The equations of motion as the papers derive them: by sympy, from T and P, with the numbers of Table 1.

This is what MuJoCo is tested against, so nothing here is read off the models. Corrected against the print: in
the angular velocity of C1 the gimbal rate stands in the first slot, as it does for C2 and as R_BC demands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import sympy as sp

# aranovskiy2020 Table 1. m is the mass of one cube with its gimbal and flywheel: that is how T and P use it.
m = 2.62
l = 0.19  # noqa: E741  the paper's name
I_b, J_b, K_b = 10e-3, 13e-3, 13e-3
I_c, J_c, K_c = 10e-4, 2.6e-4, 9.9e-4
I_d, J_d, K_d = 5.6e-4, 11e-4, 5.6e-4
omega_d = 314.0
g = 9.81
l_single = 0.13  # sokolov2019 Table I: from the pivot to the centre of mass of its one cube

# aranovskiy2020 (2), (4); sokolov2019 (1) for one cube
J1 = I_d + J_b + K_c + m * l**2 / 2
J1_single = I_d + J_b + K_c + m * l_single**2
J2 = J_c - I_d + J_d - K_c
gravity_torque = m * g * l / math.sqrt(2.0)

Function = Callable[..., np.ndarray]

STEP = 1e-30
"""Imaginary step of a coordinate [rad]: its square vanishes beside one."""


def R_AB(a: sp.Expr) -> sp.Matrix:
    """Passive rotation about y. R_CD is the same."""
    return sp.Matrix([[sp.cos(a), 0, -sp.sin(a)], [0, 1, 0], [sp.sin(a), 0, sp.cos(a)]])


def R_BC(a: sp.Expr) -> sp.Matrix:
    """Passive rotation about x."""
    return sp.Matrix([[1, 0, 0], [0, sp.cos(a), sp.sin(a)], [0, -sp.sin(a), sp.cos(a)]])


def twice_body_energy(inertia: Sequence[float], w: sp.Matrix) -> sp.Expr:
    """w' diag(inertia) w, as T writes it."""
    return w.dot(sp.diag(*inertia) * w)


def twice_module_energy(w_b: sp.Matrix, q: Sequence[sp.Expr], dq: Sequence[sp.Expr]) -> sp.Expr:
    """Gimbal's and flywheel's share of 2 T, by their angles and rates (c, d), in a frame turning with w_b."""
    w_c = sp.Matrix([dq[0], 0, 0]) + R_BC(q[0]) * w_b
    w_d = sp.Matrix([0, dq[1], 0]) + R_AB(q[1]) * w_c
    return twice_body_energy([I_d, J_d, K_d], w_d) + twice_body_energy([I_c, J_c, K_c], w_c)


class EulerLagrange:
    """Equations (1) of a system by its energies. Coordinates lie on every array's last axis."""

    kinetic: Function
    """T(q, dq) [J]."""
    potential: Function
    """P(q) [J]."""
    momenta: Function
    """dT/d(dq)(q, dq) [N m s]; constant where neither T nor P knows the coordinate."""
    mass_matrix: Function
    """M(q), (..., n, n) [kg m^2]."""

    def bias(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """What the equations have besides M ddq: tau = M ddq + bias(q, dq) [N m].

        By complex steps, which are exact to rounding: sympy takes a second for these derivatives.
        """
        turning = np.imag(self.momenta(q + 1j * STEP * dq, dq)) / STEP
        stepped = q[..., None, :] + 1j * STEP * np.eye(q.shape[-1])
        lagrangian = self.kinetic(stepped, np.broadcast_to(dq[..., None, :], stepped.shape)) - self.potential(stepped)
        return turning - np.imag(lagrangian) / STEP

    def accelerations(self, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """ddq under the generalised torques tau [rad/s^2]."""
        return np.linalg.solve(self.mass_matrix(q), (tau - self.bias(q, dq))[..., None])[..., 0]


class Lagrangian(EulerLagrange):
    """Functions of a system L = T - P in sympy, compiled."""

    def __init__(self, q: Sequence[sp.Symbol], dq: Sequence[sp.Symbol], T: sp.Expr, P: sp.Expr) -> None:
        symbols, rates = sp.Matrix(q), sp.Matrix(dq)
        kinetic, potential = _compile(sp.Matrix([T]), symbols, rates), _compile(sp.Matrix([P]), symbols)
        momenta = _compile(sp.Matrix([T]).jacobian(rates).T, symbols, rates)
        self.kinetic = lambda q, dq: kinetic(q, dq)[..., 0, 0]
        self.potential = lambda q: potential(q)[..., 0, 0]
        self.momenta = lambda q, dq: momenta(q, dq)[..., 0]

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """The momenta M dq, of which T is the quadratic form, at unit rates."""
        each = np.broadcast_to(q[..., None, :], (*q.shape, q.shape[-1]))
        return self.momenta(each, np.broadcast_to(np.eye(q.shape[-1]), each.shape)).swapaxes(-1, -2)


def _compile(matrix: sp.Matrix, *arguments: sp.Matrix) -> Function:
    """A matrix of expressions as a function of arrays (..., n), one for each column of symbols."""
    symbols = [symbol for argument in arguments for symbol in argument.flat()]
    entries = sp.lambdify(symbols, matrix.flat(), "numpy", cse=True)

    def function(*values: np.ndarray) -> np.ndarray:
        batch = np.shape(values[0])[:-1]
        columns = [column for value in values for column in np.moveaxis(value, -1, 0)]
        flat = np.stack([np.broadcast_to(entry, batch) for entry in entries(*columns)], axis=-1)
        return flat.reshape(*batch, *matrix.shape)

    return function


def _coordinates(*names: str) -> tuple[list[sp.Symbol], list[sp.Symbol]]:
    return [sp.Symbol(f"q_{name}") for name in names], [sp.Symbol(f"dq_{name}") for name in names]


@cache
def scissored_pair(K_a: float, *, yaw_term: bool = True) -> Lagrangian:
    """The six bodies of aranovskiy2020, section II. Coordinates q_a, q_b, q_c1, q_d1, q_c2, q_d2.

    Args:
        K_a: The thrust bearing's inertia about the vertical, which Table 1 does not give [kg m^2].
        yaw_term: Whether to add what T misses: the tilted frame's yaw inertia m l^2 sin^2(q_b + pi/4).
    """
    q, dq = _coordinates("a", "b", "c1", "d1", "c2", "d2")
    tilt = q[1] + sp.pi / 4
    w_a = sp.Matrix([0, 0, dq[0]])
    w_b = sp.Matrix([0, dq[1], 0]) + R_AB(q[1]) * w_a
    energy_twice = (
        twice_module_energy(w_b, q[2:4], dq[2:4])
        + twice_module_energy(w_b, q[4:6], dq[4:6])
        + 2 * twice_body_energy([I_b, J_b + m * l**2 / 2, K_b], w_b)
        + twice_body_energy([0, 0, K_a + m * l**2 / 2], w_a)
    )
    if yaw_term:
        energy_twice += m * l**2 * sp.sin(tilt) ** 2 * dq[0] ** 2
    return Lagrangian(q, dq, energy_twice / 2, sp.sqrt(2) * m * g * l * sp.cos(tilt))


@cache
def flywheel_weights(first_moment: float) -> Lagrangian:
    """Add to P the weights of flywheels whose mass times offset along d_1 is first_moment [kg m]. T is omitted."""
    q, dq = _coordinates("a", "b", "c1", "d1", "c2", "d2")
    height_1, height_2 = ((R_AB(q[k + 1]) * R_BC(q[k]) * R_AB(q[1]))[0, 2] for k in (2, 4))
    return Lagrangian(q, dq, sp.S.Zero, first_moment * g * (height_1 + height_2))


@cache
def single_gimbal() -> Lagrangian:
    """The three bodies of sokolov2019: T of the six with one cube and q_a = 0. Coordinates q_b, q_c, q_d."""
    q, dq = _coordinates("b", "c", "d")
    w_b = sp.Matrix([0, dq[0], 0])
    energy_twice = twice_body_energy([I_b, J_b + m * l_single**2, K_b], w_b) + twice_module_energy(w_b, q[1:], dq[1:])
    return Lagrangian(q, dq, energy_twice / 2, m * g * l_single * sp.cos(q[0] + sp.pi / 4))
