"""The adaptive disturbance observer of dao2023, in its general form.

The plant is (1), (2): x' = A x + B0 r + B2 u, y = C2 x + D20 r, all matrices known functions of time (and of what is
measured). The unknown r comes out of an exosystem (3), (4): xm' = Am xm, r = Cm xm. Both x and xm are estimated.

dao2023 prints L as a row, and (7) without hats and without B2 u; here L is a matrix with a column an output, the
correction is L (C2 x + D20 r - y), and A + L C2 must be stable. A is only known at each step, so that the construction
cannot see whether it is; `FriedlandTacker.require_hurwitz` checks one system.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm

from cmg_mj.core.errors import InputError, shown
from cmg_mj.core.reduced_model import is_hurwitz
from cmg_mj.papers.require import require_positive

# --- Matrices with leading dimensions ---

SYMMETRIC = 1e-10
"""Relative asymmetry of a matrix that is symmetric but for rounding."""


def require_shape(name: str, value: np.ndarray, shape: tuple[int, ...], words: str) -> None:
    """Refuse what does not end in this shape, which `words` explain."""
    if value.shape[-len(shape) :] != shape:
        raise InputError(f"{name}: must have the shape {shape}, {words}; it has {value.shape}")


def to_real(name: str, value: Any) -> np.ndarray:
    """Return an array of floats; refuse what is not real numbers."""
    try:
        array = np.asarray(value)
    except ValueError as error:  # rows of different lengths
        raise InputError(f"{name}: must be an array of real numbers, with rows of one length") from error
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name} = {shown(value)}: must be real numbers, not {array.dtype}".replace("\n", ""))
    return array.astype(float, copy=False)


def to_matrix(name: str, value: Any) -> np.ndarray:
    """Return an array of floats with at least two dimensions; refuse what is not finite."""
    matrix = to_real(name, value)
    if matrix.ndim < 2 or not np.isfinite(matrix).all():
        fault = f"not of shape {matrix.shape}" if matrix.ndim else f"not a scalar; for one number write [[{matrix:g}]]"
        raise InputError(f"{name}: must be a matrix of finite numbers, {fault}")
    return matrix


def require_positive_definite(name: str, matrix: np.ndarray) -> None:
    """Refuse a matrix that is not symmetric and positive definite."""
    mirrored = np.swapaxes(matrix, -1, -2)
    if np.abs(matrix - mirrored).max() > SYMMETRIC * np.abs(matrix).max():
        raise InputError(f"{name}: must be symmetric and positive definite; it is not symmetric")
    least = float(np.linalg.eigvalsh((matrix + mirrored) / 2.0).min())
    if least <= 0.0:
        raise InputError(f"{name}: must be symmetric and positive definite; its least eigenvalue is {least:.3g}")


def times(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Multiply matrix and vector, (..., a, b) and (..., b) -> (..., a)."""
    return (matrix @ vector[..., None])[..., 0]


def solve(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Solve for one right-hand side, (..., a, a) and (..., a) -> (..., a)."""
    if matrix.shape[-1] == 1:
        return vector / matrix[..., 0]
    return np.linalg.solve(matrix, vector[..., None])[..., 0]


# --- The adaptive disturbance observer of dao2023, in its general form ---


@dataclass(frozen=True)
class System:
    """The matrices of (1), (2) at one time. Leading dimensions, if any, number plants.

    Attributes:
        A: State matrix, (..., n, n).
        B0: Input matrix of r, (..., n, r).
        B2: Input matrix of u, (..., n, m).
        C2: Output matrix of x, (..., p, n).
        D20: Output matrix of r, (..., p, r).
    """

    A: np.ndarray
    B0: np.ndarray
    B2: np.ndarray
    C2: np.ndarray
    D20: np.ndarray

    def __post_init__(self) -> None:
        for name in ("A", "B0", "B2", "C2", "D20"):
            object.__setattr__(self, name, to_real(name, getattr(self, name)))


class State(NamedTuple):
    """The estimates, the solution of (8), the turned Gamma of (9), and the last measurement."""

    x: np.ndarray
    """Estimate of x, (..., n)."""
    xm: np.ndarray
    """Estimate of xm, (..., nm)."""
    T: np.ndarray
    """T of (8), (..., n, nm)."""
    P: np.ndarray
    """exp(Am t) Gamma exp(Am^T t), (..., nm, nm)."""
    y: np.ndarray
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
    Am: np.ndarray
    Cm: np.ndarray
    L: np.ndarray
    Gamma: np.ndarray
    Sigma: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "dt", require_positive("dt", self.dt))
        for name in ("Am", "Cm", "L", "Gamma", "Sigma"):
            object.__setattr__(self, name, to_matrix(name, getattr(self, name)))
        nm, p = self.Am.shape[-1], self.L.shape[-1]
        require_shape("Am", self.Am, (nm, nm), "square")
        if self.Am.ndim > 2 or self.Cm.ndim > 2:
            raise InputError("Am, Cm: all observers must share one exosystem, two matrices without leading dimensions")
        require_shape("Cm", self.Cm, (self.Cm.shape[0], nm), "(r, nm), a column an exosystem state of Am")
        require_shape("Gamma", self.Gamma, (nm, nm), "(nm, nm), as Am")
        require_shape("Sigma", self.Sigma, (p, p), "(p, p), p the columns of L")
        for name in ("Gamma", "Sigma"):
            require_positive_definite(name, getattr(self, name))

    @classmethod
    def conventional(cls, dt: float, L: np.ndarray, Gamma: np.ndarray, Sigma: np.ndarray) -> FriedlandTacker:
        """Make the adaptive observer of Zhang (2002) and Liu, Zhang, Su (2011): r constant, Am = 0, Cm = I.

        Args:
            dt: Sample period [s].
            L: Gain that makes A + L C2 stable, (..., n, p).
            Gamma: Weight of the parameters, (..., r, r).
            Sigma: Weight of the measurement, (..., p, p).

        Returns:
            The observer; its T is the papers' Upsilon.
        """
        r = to_matrix("Gamma", Gamma).shape[-1]
        return cls(dt, np.zeros((r, r)), np.eye(r), L, Gamma, Sigma)

    @property
    def sizes(self) -> dict[str, int]:
        """The dimensions n, p, r, nm."""
        return {"n": self.L.shape[-2], "p": self.L.shape[-1], "r": self.Cm.shape[0], "nm": self.Am.shape[0]}

    @cached_property
    def _turn(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """F = exp(Am h) and its inverse, (nm, nm), and Cm (F + I)/2, (r, nm)."""
        F = expm(self.Am * self.dt)
        return F, expm(-self.Am * self.dt), self.Cm @ ((F + np.eye(len(F))) / 2.0)

    @cached_property
    def _fitting(self) -> set[tuple[tuple[int, ...], ...]]:
        """Shapes of a step's arguments that have been found to fit."""
        return set()

    @cached_property
    def _identities(self) -> tuple[np.ndarray, np.ndarray]:
        """Identity matrices of the dimensions n and p."""
        return np.eye(self.L.shape[-2]), np.eye(self.L.shape[-1])

    def init(
        self,
        y: np.ndarray,
        x: np.ndarray | None = None,
        xm: np.ndarray | None = None,
        T: np.ndarray | None = None,
    ) -> State:
        """Return the state at the first sample.

        Args:
            y: The first measurement, (..., p).
            x: Estimate of x, (..., n); zero if not given.
            xm: Estimate of xm, (..., nm); zero if not given.
            T: T(0), (..., n, nm); zero if not given.

        Returns:
            The state.

        Raises:
            ValueError: A vector or matrix does not fit.
        """
        n, p, _, nm = self.sizes.values()
        y = to_real("y", y)
        x = np.zeros(n) if x is None else to_real("x", x)
        xm = np.zeros(nm) if xm is None else to_real("xm", xm)
        T = np.zeros((n, nm)) if T is None else to_real("T", T)
        require_shape("y", y, (p,), "(p,), p the columns of L")
        require_shape("x", x, (n,), "(n,), n the rows of L")
        require_shape("xm", xm, (nm,), "(nm,), as Am")
        require_shape("T", T, (n, nm), "(n, nm), n the rows of L, nm those of Am")
        return State(x, xm, T, self.Gamma, y)

    def step(
        self,
        state: State,
        system: System,
        u: np.ndarray,
        y: np.ndarray,
        *,
        L: np.ndarray | None = None,
        C2: np.ndarray | None = None,
        D20: np.ndarray | None = None,
    ) -> State:
        """Advance by one sample period.

        Args:
            state: The state at sample k-1.
            system: The plant's matrices in the middle between the samples.
            u: The input there, (..., m).
            y: The measurement at sample k, (..., p).
            L: The gain there, if it varies with time.
            C2: The output matrix at sample k itself, if it varies with time.
            D20: The same of D20.

        Returns:
            The state at sample k.

        Raises:
            ValueError: A matrix or vector does not fit.
        """
        u, y = to_real("u", u), to_real("y", y)
        L = self.L if L is None else to_real("L", L)
        C2 = system.C2 if C2 is None else to_real("C2", C2)
        D20 = system.D20 if D20 is None else to_real("D20", D20)
        self._check(system, u, y, L, C2, D20)
        h = self.dt
        F, F_back, Cm_middle = self._turn
        I_n, I_p = self._identities
        x, xm, T, P, y_before = state

        half = h / 2.0 * (system.A + L @ system.C2)
        W = (system.B0 + L @ system.D20) @ Cm_middle
        input_terms = times(system.B2, u) - times(L, (y_before + y) / 2.0)
        right_x = x + times(half, x) + h * (times(W, xm) + input_terms)
        right_T = T + half @ T + h * W
        x = solve(I_n - half, right_x)
        T = np.linalg.solve(I_n - half, right_T) @ F_back
        xm = times(F, xm)
        P = F @ P @ F.T

        D20_Cm = D20 @ self.Cm
        G = C2 @ T + D20_Cm
        gain = P @ np.swapaxes(G, -1, -2) @ self.Sigma  # -Lm
        nu = solve(I_p + h * (G @ gain), times(C2, x) + times(D20_Cm, xm) - y)
        step = -h * times(gain, nu)
        return State(x + times(T, step), xm + step, T, P, y)

    def require_hurwitz(self, system: System) -> None:
        """Refuse a gain with which A + L C2 is not Hurwitz.

        For a constant system this is what the observer needs. For one that varies with time it is neither necessary
        nor enough, but a gain that fails it at all times is a slip, such as a wrong sign.

        Args:
            system: The plant's matrices, at one time.

        Raises:
            ValueError: A or C2 does not fit, or an eigenvalue of A + L C2 is not in the open left half plane.
        """
        n, p, _, _ = self.sizes.values()
        require_shape("A", system.A, (n, n), "(n, n), n the rows of L")
        require_shape("C2", system.C2, (p, n), "(p, n), the shape of L transposed")
        poles = np.linalg.eigvals(system.A + self.L @ system.C2)
        rightmost = poles.ravel()[np.argmax(poles.real)]
        if not is_hurwitz(poles):
            raise InputError(f"L: A + L C2 must be Hurwitz; it has the eigenvalue {rightmost:.3g}")

    def slope(
        self, t: float, x: np.ndarray, xm: np.ndarray, T: np.ndarray, system: System, u: np.ndarray, y: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
        A, B0, B2, C2, D20 = system.A, system.B0, system.B2, system.C2, system.D20
        Am, Cm, L = self.Am, self.Cm, self.L
        n, nm = T.shape
        turn = expm(Am * t)
        Lm = -turn @ self.Gamma @ turn.T @ (C2 @ T + D20 @ Cm).T @ self.Sigma  # (9)
        augmented_A = np.block([[A, B0 @ Cm], [np.zeros((nm, n)), Am]])
        augmented_B = np.vstack([B2, np.zeros((nm, B2.shape[1]))])
        augmented_C = np.hstack([C2, D20 @ Cm])
        augmented_L = np.vstack([L + T @ Lm, Lm])
        estimates = np.concatenate([x, xm])
        estimates = augmented_A @ estimates + augmented_B @ u + augmented_L @ (augmented_C @ estimates - y)  # (7)
        return estimates[:n], estimates[n:], (A + L @ C2) @ T - T @ Am + (B0 + L @ D20) @ Cm  # (8)

    def _check(
        self,
        system: System,
        u: np.ndarray,
        y: np.ndarray,
        L: np.ndarray,
        C2: np.ndarray,
        D20: np.ndarray,
    ) -> None:
        """Refuse what does not fit; shapes that have been found to fit are not looked at again."""
        shapes = tuple(a.shape for a in (system.A, system.B0, system.B2, system.C2, system.D20, u, y, L, C2, D20))
        if shapes in self._fitting:
            return
        n, p, r, _ = self.sizes.values()
        require_shape("A", system.A, (n, n), "(n, n), n the rows of L")
        require_shape("B0", system.B0, (n, r), "(n, r), n the rows of L, r those of Cm")
        m = system.B2.shape[-1] if system.B2.ndim > 1 else 0
        require_shape("B2", system.B2, (n, m), "(n, m), n the rows of L")
        require_shape("u", u, (m,), "(m,), m the columns of B2")
        require_shape("y", y, (p,), "(p,), p the columns of L")
        for matrix in (system.C2, C2):
            require_shape("C2", matrix, (p, n), "(p, n), the shape of L transposed")
        for matrix in (system.D20, D20):
            require_shape("D20", matrix, (p, r), "(p, r), p the columns of L, r the rows of Cm")
        require_shape("L", L, (n, p), "(n, p), as the L of the construction")
        self._fitting.add(shapes)
