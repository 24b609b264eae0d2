"""The adaptive disturbance observer of dao2023, in its general form.

The plant is (1), (2): x' = A x + B0 r + B2 u, y = C2 x + D20 r, all matrices known functions of time (and of what is
measured). The unknown r comes out of an exosystem (3), (4): xm' = Am xm, r = Cm xm. Both x and xm are estimated.

dao2023 prints L as a row, and (7) without hats and without B2 u; here L is a matrix with a column an output, the
correction is L (C2 x + D20 r - y), and A + L C2 must be stable.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

Array = np.ndarray


def times(matrix: Array, vector: Array) -> Array:
    """Multiply matrix and vector, (..., a, b) and (..., b) -> (..., a)."""
    return (matrix @ vector[..., None])[..., 0]


def solve(matrix: Array, vector: Array) -> Array:
    """Solve for one right-hand side, (..., a, a) and (..., a) -> (..., a)."""
    if matrix.shape[-1] == 1:
        return vector / matrix[..., 0]
    return np.linalg.solve(matrix, vector[..., None])[..., 0]


class System(NamedTuple):
    """The matrices of (1), (2) at one time. Leading dimensions, if any, number plants."""

    A: Array
    """State matrix, (..., n, n)."""
    B0: Array
    """Input matrix of r, (..., n, r)."""
    B2: Array
    """Input matrix of u, (..., n, m)."""
    C2: Array
    """Output matrix of x, (..., p, n)."""
    D20: Array
    """Output matrix of r, (..., p, r)."""


class State(NamedTuple):
    """The estimates, the solution of (8), the turned Gamma of (9), and the last measurement."""

    x: Array
    """Estimate of x, (..., n)."""
    xm: Array
    """Estimate of xm, (..., nm)."""
    T: Array
    """T of (8), (..., n, nm)."""
    P: Array
    """exp(Am t) Gamma exp(Am^T t), (..., nm, nm)."""
    y: Array
    """The last measurement, (..., p)."""


@dataclass(frozen=True)
class FriedlandTacker:
    """dao2023 (7) with T from the Friedland-Tacker equation (8) and the auxiliary gain (9).

    With M = A + L C2 and W = (B0 + L D20) Cm:

        x' = M x + W xm + B2 u - L y + T Lm nu,   xm' = Am xm + Lm nu,   nu = C2 x + D20 Cm xm - y,
        T' = M T - T Am + W,   Lm = -exp(Am t) Gamma exp(Am^T t) (C2 T + D20 Cm)^T Sigma.

    One step a sample, the measurement running straight between samples, in two parts:

    1. x and T by the implicit midpoint rule, xm and P = exp(Am t) Gamma exp(Am^T t) exactly.
    2. the terms with Lm implicit in the new sample, as in a Kalman filter's update:
       nu = (I + h G P G^T Sigma)^-1 nu^-, G = C2 T + D20 Cm.

    Both are stable at any h Sigma. For constant C2 and D20 the step keeps what makes the observer work: for a plant
    discretised by the same midpoint rule, z = (x^ - x) - T (xm^ - xm) obeys z+ = (I - h/2 M)^-1 (I + h/2 M) z exactly,
    whatever Gamma and Sigma, as z' = M z holds in continuous time.

    Leading dimensions of any argument number observers that run at once; they are broadcast.

    Attributes:
        dt: Sample period h [s].
        Am: Exosystem's matrix, (nm, nm).
        Cm: Its output matrix, (r, nm).
        L: Gain that makes A + L C2 stable, (..., n, p).
        Gamma: Weight of xm, symmetric positive definite, (..., nm, nm).
        Sigma: Weight of the measurement, symmetric positive definite, (..., p, p).
    """

    dt: float
    Am: Array
    Cm: Array
    L: Array
    Gamma: Array
    Sigma: Array

    @classmethod
    def conventional(cls, dt: float, L: Array, Gamma: Array, Sigma: Array) -> FriedlandTacker:
        """Make the adaptive observer of Zhang (2002) and Liu, Zhang, Su (2011): r constant, Am = 0, Cm = I.

        Args:
            dt: Sample period [s].
            L: Gain that makes A + L C2 stable, (..., n, p).
            Gamma: Weight of the parameters, (..., r, r).
            Sigma: Weight of the measurement, (..., p, p).

        Returns:
            The observer; its T is the papers' Upsilon.
        """
        r = Gamma.shape[-1]
        return cls(dt, np.zeros((r, r)), np.eye(r), L, Gamma, Sigma)

    @cached_property
    def _turn(self) -> tuple[Array, Array, Array]:
        """F = exp(Am h) and its inverse, (nm, nm), and Cm (F + I)/2, (r, nm)."""
        F = expm(self.Am * self.dt)
        return F, expm(-self.Am * self.dt), self.Cm @ ((F + np.eye(len(F))) / 2.0)

    def init(self, y: Array, x: Array | None = None, xm: Array | None = None) -> State:
        """Return the state at the first sample, with T = 0.

        Args:
            y: The first measurement, (..., p).
            x: Estimate of x, (..., n); zero if not given.
            xm: Estimate of xm, (..., nm); zero if not given.

        Returns:
            The state.
        """
        n, nm = self.L.shape[-2], self.Am.shape[0]
        x, xm = np.zeros(n) if x is None else x, np.zeros(nm) if xm is None else xm
        return State(x, xm, np.zeros((n, nm)), self.Gamma, y)

    def step(self, state: State, system: System, u: Array, y: Array) -> State:
        """Advance by one sample period.

        Args:
            state: The state at sample k-1.
            system: The plant's matrices in the middle between the samples.
            u: The input there, (..., m).
            y: The measurement at sample k, (..., p).

        Returns:
            The state at sample k.
        """
        h, L = self.dt, self.L
        F, F_back, Cm_middle = self._turn
        x, xm, T, P, y_before = state

        half = h / 2.0 * (system.A + L @ system.C2)
        W = (system.B0 + L @ system.D20) @ Cm_middle
        input_terms = times(system.B2, u) - times(L, (y_before + y) / 2.0)
        implicit = np.eye(L.shape[-2]) - half
        x = solve(implicit, x + times(half, x) + h * (times(W, xm) + input_terms))
        T = np.linalg.solve(implicit, T + half @ T + h * W) @ F_back
        xm = times(F, xm)
        P = F @ P @ F.T

        D20_Cm = system.D20 @ self.Cm
        G = system.C2 @ T + D20_Cm
        gain = P @ np.swapaxes(G, -1, -2) @ self.Sigma  # -Lm
        nu = solve(np.eye(L.shape[-1]) + h * (G @ gain), times(system.C2, x) + times(D20_Cm, xm) - y)
        step = -h * times(gain, nu)
        return State(x + times(T, step), xm + step, T, P, y)

    def slope(
        self, t: float, x: Array, xm: Array, T: Array, system: System, u: Array, y: Array
    ) -> tuple[Array, Array, Array]:
        """Evaluate the observer in continuous time, (7) to (9) as they are printed, with B2 u and the hats put back.

        Args:
            t: Time [s].
            x: Estimate of x, (n,).
            xm: Estimate of xm, (nm,).
            T: T, (n, nm).
            system: The plant's matrices at that time.
            u: The input, (m,).
            y: The measurement, (p,).

        Returns:
            Derivatives of x, xm and T.
        """
        (A, B0, B2, C2, D20), Am, Cm, L = system, self.Am, self.Cm, self.L
        n, nm = T.shape
        turn = expm(Am * t)
        Lm = -turn @ self.Gamma @ turn.T @ (C2 @ T + D20 @ Cm).T @ self.Sigma  # (9)
        both = np.concatenate([x, xm])
        innovation = np.hstack([C2, D20 @ Cm]) @ both - y
        known = np.block([[A, B0 @ Cm], [np.zeros((nm, n)), Am]]) @ both + np.concatenate([B2 @ u, np.zeros(nm)])
        both = known + np.vstack([L + T @ Lm, Lm]) @ innovation  # (7)
        return both[:n], both[n:], (A + L @ C2) @ T - T @ Am + (B0 + L @ D20) @ Cm  # (8)
