"""The bioreactor of section 3: Contois model (14), observability form (15), bounds on its increments."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cmg_mj.papers.andrieu2009.paper import U_MAX, U_MIN

# Normalised variables: no units; time is the paper's, in its normalised seconds.
Array = Any
"""A float or an array; everything here is elementwise."""


@dataclass(frozen=True)
class Bioreactor:
    """(14) with one value of hbar, and the set M_eta in which it stays.

    Attributes:
        hbar: Parameter of the Contois model.
        u_min: Least input.
        u_max: Largest input.
    """

    hbar: float
    u_min: float = U_MIN
    u_max: float = U_MAX

    @cached_property
    def eps2(self) -> float:
        """The largest epsilon_2 that u_min >= eps2/(hbar (1 - eps2) + eps2) allows."""
        return self.u_min * self.hbar / (1.0 - self.u_min + self.u_min * self.hbar)

    @cached_property
    def eps1(self) -> float:
        """epsilon_1 that belongs to it."""
        return (1.0 - self.u_max) * self.eps2 / (self.hbar * self.u_max)

    def slope(self, eta1: Array, eta2: Array, u: Array) -> tuple[Array, Array]:
        """Return the right-hand side of (14)."""
        growth = eta1 * eta2 / (self.hbar * eta1 + eta2)
        return growth - u * eta1, -growth + u * (1.0 - eta2)

    def to_x2(self, eta1: Array, eta2: Array) -> Array:
        """Return the second component of F."""
        return eta1 * eta2 / (self.hbar * eta1 + eta2)

    def to_eta2(self, x1: Array, x2: Array) -> Array:
        """Return the second component of F's inverse."""
        return self.hbar * x1 * x2 / (x1 - x2)

    def x2_bounds(self, x1: Array) -> tuple[Array, Array]:
        """Return the least and largest x2 of M_x at an x1 that lies in [eps1, 1 - eps2]."""
        part, remainder = self.hbar * x1, 1.0 - x1
        return x1 * self.eps2 / (part + self.eps2), x1 * remainder / (remainder + part)

    def limit_x1(self, x1: Array) -> Array:
        """Return x_1s."""
        return np.minimum(np.maximum(x1, self.eps1), 1.0 - self.eps2)

    def limit_x2(self, x1: Array, x2: Array) -> Array:
        """Return x_2s for an x1 that is x_1s."""
        low, high = self.x2_bounds(x1)
        return np.maximum(low, np.minimum(high, x2))

    def coefficients(self, x1: Array, u: Array) -> tuple[Array, Array, Array, Array]:
        """Return m0 to m3 of (15)."""
        hbar = self.hbar
        first, second = hbar * x1, hbar * x1**2
        return (
            u / hbar,
            -u - 1.0 / hbar - 2.0 * u / first,
            2.0 / first + u / second,
            (hbar - 1.0) / second,
        )

    def f2(self, x1: Array, x2: Array, u: Array) -> Array:
        """Return f2 of (15)."""
        m0, m1, m2, m3 = self.coefficients(x1, u)
        return m0 + x2 * (m1 + x2 * (m2 + x2 * m3))

    def f2_slope(self, x1: Array, x2: Array, u: Array) -> Array:
        """Return df2/dx2."""
        _, m1, m2, m3 = self.coefficients(x1, u)
        return m1 + x2 * (2.0 * m2 + 3.0 * m3 * x2)

    def domain(self, points: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a grid of M_u x M_x with its corners, denser at small x1: x1, x2, u, each (points, points, points)."""
        x1 = np.geomspace(self.eps1, 1.0 - self.eps2, points)[:, None, None]
        low, high = self.x2_bounds(x1)
        x2 = low + (high - low) * np.linspace(0.0, 1.0, points)[None, :, None]
        u = np.linspace(self.u_min, self.u_max, points)[None, None, :]
        x1, x2, u = np.broadcast_arrays(x1, x2, u)
        return x1, x2, u

    @cached_property
    def df2_max(self) -> float:
        """df_2max: the largest |df2/dx2| over M_u x M_x, for the constant gain."""
        return float(np.abs(self.f2_slope(*self.domain(120))).max())

    def Omega1(self, u: Array, x1: Array, x2_hat: Array) -> Array:
        """Return Omega_1, for the updated gain: the largest |slope of a secant of f2 from x2_hat|.

        The secant's slope is a parabola in x2, so it is largest at an end of the interval or at the vertex.

        Args:
            u: Input.
            x1: x_1s.
            x2_hat: Estimate, limited.

        Returns:
            The bound.
        """
        _, m1, m2, m3 = self.coefficients(x1, u)
        low, high = self.x2_bounds(x1)
        m = m2 + m3 * x2_hat
        vertex = np.minimum(np.maximum(-0.5 * m / _not_zero(m3), low), high)
        return _largest(lambda x2: m1 + m * (x2_hat + x2) + m3 * x2**2, low, high, vertex)

    def Omega2(self, u: Array, x1: Array, x2_hat: Array, p: float, *, with_misprint: bool = False) -> Array:
        """Return Omega_2, for the updated gain and the homogeneous correction.

        Its last term is m3 x2^(2-p); the paper prints m2 there, which is not what its inequality needs. Its derivative
        by x2 has one zero, so it is largest at an end of the interval or there.

        Args:
            u: Input.
            x1: x_1s.
            x2_hat: Estimate, limited.
            p: Power of the error term.
            with_misprint: Take m2 in the last term.

        Returns:
            The bound.
        """
        _, m1, m2, m3 = self.coefficients(x1, u)
        low, high = self.x2_bounds(x1)
        m, last_coefficient = m2 + m3 * x2_hat, m2 if with_misprint else m3
        stationary = -m * (1.0 - p) / (_not_zero(last_coefficient) * (2.0 - p))
        stationary = np.minimum(np.maximum(stationary, low), high)
        rate_at_estimate = m1 + m * x2_hat
        share = x2_hat**p

        def incremental_rate(x2: Array) -> Array:
            return rate_at_estimate + share * x2 ** (1.0 - p) * (m + last_coefficient * x2)

        return _largest(incremental_rate, low, high, stationary)

    def c_inf(self, p: float, points: int = 40) -> float:
        """Return c_inf of the same bound, over a grid of the domain."""
        x1, x2, u = (grid[..., None] for grid in self.domain(points))
        lowest, _ = self.x2_bounds(self.eps1)
        _, highest = self.x2_bounds(1.0 - self.eps2)
        x2_hat = np.linspace(float(lowest), float(highest), points)
        _, _, m2, m3 = self.coefficients(x1, u)
        return float(np.abs((m2 + m3 * x2_hat) * x2 ** (1.0 - p) + m3 * x2 ** (2.0 - p)).max())


def _largest(function: Any, *arguments: Array) -> Array:
    values = [np.abs(function(x2)) for x2 in arguments]
    return np.maximum(np.maximum(values[0], values[1]), values[2])


def _not_zero(m: Array) -> Array:
    """Replace 0 by a tiny number: for hbar = 1, m3 = 0 and there is no stationary point."""
    return np.where(m == 0.0, 1e-300, m)
