"""Section 4.2, (19) and (20): the function W for two dimensions, built as the recursive design does, and its decay.

The error obeys e1' = A1 (e2 - q1(l1 e1)), e2' = -A2 q2(l2 q1(l1 e1)), with A1, A2 anywhere between the bounds of (17).
With s1 = l1 e1, and s2 such that e2 = q1(s2),

    W = H(s1) - H(s2) - h(s2) (s1 - s2) + sigma |e2|^d_W/d_W,    h = H',    h(s) = [s]^(d_W - 1) + [s]^(d_W/r1 - 1)

whose first part is never negative and vanishes where s1 = s2, that is, where e1' = 0. It is homogeneous in the bi-limit
with the weights (1, 1) and (r1, 1), r1 = 1 - d_inf. Every state is drawn by its (s1, s2): q1 need not be inverted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import signed_power
from cmg_mj.papers.andrieu2009.bi_limit import BiLimitCorrection

SCALES = np.geomspace(1e-8, 1e8, 65)
"""Scales of the states, from where W is that of its limit at 0 to where it is that at infinity."""
ANGLES = 120


class States(NamedTuple):
    """Points of the plane, each (n,)."""

    s1: np.ndarray
    s2: np.ndarray


def states(scales: np.ndarray = SCALES, angles: int = ANGLES) -> States:
    """Return states on squares of all scales, denser where s1 and s2 are nearly alike or one of them is small."""
    share = np.linspace(-1.0, 1.0, angles)
    shares = np.concatenate([share, np.geomspace(1e-3, 1.0, 40), 1.0 - np.geomspace(1e-3, 1.0, 40)])
    ends = np.ones_like(shares)
    s1 = np.concatenate([ends, -ends, shares, shares])
    s2 = np.concatenate([shares, shares, ends, -ends])
    return States(*(np.multiply.outer(scales, s).ravel() for s in (s1, s2)))


@dataclass(frozen=True)
class Lyapunov:
    """W for n = 2.

    Attributes:
        K: The correction, of two dimensions.
        sigma: Weight of the part in e2.
        d_W: Its degree, at least 2 + d_inf.
    """

    K: BiLimitCorrection
    sigma: float
    d_W: float

    @property
    def powers(self) -> tuple[float, float]:
        """The two powers in h."""
        r1 = 1.0 - self.K.d_inf
        return self.d_W - 1.0, self.d_W / r1 - 1.0

    def q1(self, s: np.ndarray) -> np.ndarray:
        """Return q1, whose two terms are one if d_inf = 0."""
        return s if not self.K.d_inf else s + signed_power(s, self.K.exponents[0])

    def q1_slope(self, s: np.ndarray) -> np.ndarray:
        """Return the derivative of q1."""
        a = self.K.exponents[0]
        return np.ones_like(s) if not self.K.d_inf else 1.0 + a * np.abs(s) ** (a - 1.0)

    def h(self, s: np.ndarray) -> np.ndarray:
        """Return the integrand of W."""
        first, second = self.powers
        return signed_power(s, first) + signed_power(s, second)

    def h_slope(self, s: np.ndarray) -> np.ndarray:
        """Return the derivative of h."""
        first, second = self.powers
        return first * np.abs(s) ** (first - 1.0) + second * np.abs(s) ** (second - 1.0)

    def H(self, s: np.ndarray) -> np.ndarray:
        """Return the integral of h."""
        first, second = (power + 1.0 for power in self.powers)
        return np.abs(s) ** first / first + np.abs(s) ** second / second

    def E(self, grid: States) -> tuple[np.ndarray, np.ndarray]:
        """Return e1 and e2."""
        return grid.s1 / self.K.l[0], self.q1(grid.s2)

    def W(self, grid: States) -> np.ndarray:
        """Return W, (n,)."""
        first = self.H(grid.s1) - self.H(grid.s2) - self.h(grid.s2) * (grid.s1 - grid.s2)
        return first + self.sigma * np.abs(self.q1(grid.s2)) ** self.d_W / self.d_W

    def gradient(self, grid: States) -> tuple[np.ndarray, np.ndarray]:
        """Return dW/de1 and dW/de2, each (n,)."""
        by_s2 = -self.h_slope(grid.s2) * (grid.s1 - grid.s2) / self.q1_slope(grid.s2)
        return (
            self.K.l[0] * (self.h(grid.s1) - self.h(grid.s2)),
            by_s2 + self.sigma * signed_power(self.q1(grid.s2), self.d_W - 1.0),
        )


class Decay(NamedTuple):
    """The largest constants with which (19) and (20) hold at all states tried; not positive if they do not hold."""

    c1: float
    c2: float


def decay(W: Lyapunov, b: float, spread: float = 0.0, grid: States | None = None) -> Decay:
    """Try (19) and (20).

    Args:
        W: The function.
        b: Exponent of the scaling: B = diag(b, 1 + b) in (20).
        spread: A1 and A2 are anywhere in [1 - spread, 1 + spread]; both sides of (19) are linear in them.
        grid: States tried; by default on all scales.

    Returns:
        c1 and c2.
    """
    grid = states() if grid is None else grid
    # Where s1 and s2 are nearer, W is rounding errors.
    distinct = np.abs(grid.s1 - grid.s2) > 1e-9 * np.maximum(np.abs(grid.s1), np.abs(grid.s2))
    grid = States(grid.s1[distinct], grid.s2[distinct])
    (e1, e2), (by_e1, by_e2), value = W.E(grid), W.gradient(grid), W.W(grid)
    k1, k2 = W.K(e1)
    slopes = by_e1 * (e2 + k1), by_e2 * k2
    largest = sum(np.maximum((1.0 - spread) * part, (1.0 + spread) * part) for part in slopes)
    bound = value + value ** ((W.d_W + W.K.d_inf) / W.d_W)
    growth = by_e1 * b * e1 + by_e2 * (1.0 + b) * e2
    return Decay(float((-largest / bound).min()), float((growth / value).min()))
