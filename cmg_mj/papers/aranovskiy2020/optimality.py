"""Are the gains K_e of aranovskiy2020's Table 2 those of an LQR? Inverse optimality by the return difference."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, solve_continuous_are
from scipy.optimize import minimize

from cmg_mj.papers.aranovskiy2020.paper import K_E, K_E_ROUNDING, printed_model
from cmg_mj.papers.claim import Claim, OnShare


class Inverse(NamedTuple):
    """The answer of the return difference for a gain."""

    least: float
    """min over w of |1 + K (jw - A)^-1 B|."""
    optimal: bool
    """True if some Q >= 0 makes K the LQR gain (Kalman 1964: the minimum is not below 1)."""
    Q: np.ndarray | None
    """A Q of that kind, (n, n), of rank 1."""
    recovered: float
    """Relative error of the Riccati equation's gain for that Q."""
    diagonal: np.ndarray
    """The one diagonal of Q that would give K: with a negative entry no diagonal Q >= 0 does."""


def inverse_optimality(A: np.ndarray, B: np.ndarray, K: np.ndarray) -> Inverse:
    """Decide whether K is the LQR gain of x' = A x + B u for some cost x' Q x + u^2.

    With d the open-loop and p the closed-loop polynomial and n_i/d the transfer function to x_i, a cost Q = diag(q)
    gives |p(jw)|^2 - |d(jw)|^2 = sum of q_i |n_i(jw)|^2, and Q = c c' gives |sum of c_i n_i|^2.

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, 1).
        K: Gain, (n,).

    Returns:
        The answer.
    """
    n = len(A)
    d, p = np.poly(A), np.poly(A - B @ K[None, :])
    unit = np.eye(n)
    numerators = np.array([np.poly(A - B @ unit[i][None, :]) - d for i in range(n)])  # d + n_i is that of u = -x_i
    gap = (_squared(p) - _squared(d))[1:]  # in w^2, degree n - 1
    roots = np.roots(gap)
    crossings = [w for w in roots if abs(w.imag) < 1e-9 * (1.0 + abs(w)) and w.real > 0.0]
    grid = np.concatenate([np.logspace(-6, 8, 4001), [abs(w.real) for w in crossings]])
    ratio = np.polyval(_squared(p), grid) / np.polyval(_squared(d), grid)
    optimal = bool(np.polyval(gap, grid).min() >= 0.0 and gap[-1] >= 0.0)
    basis = np.column_stack([_squared(row) for row in numerators])[1:]
    diagonal = np.linalg.lstsq(basis, gap, rcond=None)[0]
    if not optimal:
        return Inverse(float(np.sqrt(ratio.min())), False, None, math.inf, diagonal)
    # Spectral factor: the half of the roots of gap(-s^2) to the left.
    left_roots = [-np.sqrt(-w) if np.sqrt(-w).real > 0.0 else np.sqrt(-w) for w in roots.astype(complex)]
    factor = math.sqrt(abs(gap[0])) * np.real(np.poly(left_roots))
    c = np.linalg.solve(numerators[:, 1:].T, factor)
    Q = np.outer(c, c)
    P = solve_continuous_are(A, B, Q, np.eye(1))
    recovered = float(np.abs((B.T @ P)[0] / K - 1.0).max())
    return Inverse(float(np.sqrt(ratio.min())), True, Q, recovered, diagonal)


def _squared(polynomial: np.ndarray) -> np.ndarray:
    """Return |p(jw)|^2 as a polynomial in w^2, highest power first."""
    n = len(polynomial) - 1
    mirrored = polynomial * (-1.0) ** (n - np.arange(n + 1))
    even = np.convolve(polynomial, mirrored)[::2]  # p(s) p(-s) in s^2
    return even * (-1.0) ** (n - np.arange(n + 1))  # s^2 = -w^2


class Diagonal(NamedTuple):
    """The diagonal Q whose LQR gain comes nearest to a printed one."""

    Q: np.ndarray
    """Entries of the diagonal, none below 0, (n,)."""
    gain: np.ndarray
    """LQR gain with R = 1, (n,)."""
    off: float
    """Largest difference from the printed gain, by half a unit of the digit it is printed with: 1 is rounding's."""


def lqr_gain(A: np.ndarray, B: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
    """Return the gain for Q = diag(diagonal), R = 1, (n,)."""
    return (B.T @ solve_continuous_are(A, B, np.diag(diagonal), np.eye(1)))[0]


LEAST_WEIGHT = 1e-3
"""Least weight in a diagonal Q: a state that hardly counts."""


def nearest_diagonal(
    A: np.ndarray, B: np.ndarray, K: np.ndarray, rounding: np.ndarray, start: np.ndarray, searches: int = 3
) -> Diagonal:
    """Search the diagonal Q whose gain comes nearest to K.

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, 1).
        K: The gain as printed, (n,).
        rounding: Half a unit of the digit that each entry of it is printed with, (n,).
        start: A diagonal near the one sought, (n,); entries below 0.01 count as 0.01.
        searches: Number of starts of the search, each from where it ended: a simplex may collapse.

    Returns:
        The best that was found.
    """

    def weights(logarithms: np.ndarray) -> np.ndarray:
        return np.maximum(np.exp(logarithms), LEAST_WEIGHT)

    def off(logarithms: np.ndarray) -> float:
        try:
            return float((np.abs(lqr_gain(A, B, weights(logarithms)) - K) / rounding).max())
        except LinAlgError:  # Q with entries too far apart for the solver
            return math.inf

    optimum = np.log(np.maximum(start, 0.01))
    for _ in range(searches):
        optimum = minimize(off, optimum, method="Nelder-Mead", options={"maxiter": 150, "xatol": 1e-3, "fatol": 1e-3}).x
    return Diagonal(weights(optimum), lqr_gain(A, B, weights(optimum)), off(optimum))


def lqr_gains() -> Claim:
    """Judge whether Table 2's K_e is an LQR gain."""
    model = printed_model()
    K = np.array(K_E)
    inverse = inverse_optimality(model.A_e, model.B_e, K)
    nearest = nearest_diagonal(model.A_e, model.B_e, K, np.array(K_E_ROUNDING), inverse.diagonal)
    return Claim(
        place="Table 2, K_e",
        statement="K_e = [35, 4, -1, 0.3] are LQR gains; the weights are not given.",
        holds=inverse.optimal and inverse.recovered < 1e-6,
        conditions=(
            ""
            if nearest.off < 1.0
            else "The cost is not a weighted sum of squares of the single states, not even to the digits printed."
        ),
        otherwise="They are no LQR gains.",
        figures={
            "least_return_difference": inverse.least,
            "recovered_gain_relative_error": inverse.recovered if inverse.optimal else None,
            "Q": None if inverse.Q is None else inverse.Q.tolist(),
            "diagonal_candidate": inverse.diagonal.tolist(),
            "diagonal_within_rounding": nearest.Q.tolist(),
            "gain_within_rounding": nearest.gain.tolist(),
            "difference_by_rounding": nearest.off,
        },
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the gains of (8)."""
    return [lqr_gains()]
