"""The high-gain observer with updated gain and homogeneous correction, andrieu2009 (7)-(10), in its general form.

V. Andrieu, L. Praly, A. Astolfi, "High gain observers with updated gain and homogeneous correction terms",
Automatica 45 (2009). The construction of K is that of their "Homogeneous approximation, recursive observer design, and
output feedback", SIAM Journal on Control and Optimization 47 (2008); for n = 2 it gives the q1, q2 of the 2009 paper's
example.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cmg_mj.core.arrays import Scalar, signed_power
from cmg_mj.observers.high_gain import updated_gain
from cmg_mj.papers.recorded import runge_kutta

# --- The correction term: a vector field K that is homogeneous in the bi-limit, for any dimension ---


def weights(n: int, d_inf: float) -> list[float]:
    """Return r_inf,i = 1 - d_inf (n - i), i = 1..n+1, (18): the weights at infinity, r_inf,n + d_inf last."""
    return [1.0 - d_inf * (n - i) for i in range(1, n + 2)]


@dataclass(frozen=True)
class BiLimitCorrection:
    """K(e1) = (-q_1(l_1 e1), -q_2(l_2 q_1(l_1 e1)), ...) with q_i(s) = s + [s]^(r_inf,i+1/r_inf,i).

    Here [s]^a = |s|^a sign s, the paper's signed power.

    K is homogeneous in the bi-limit: near 0 it is linear (weights 1, degree 0), far out it has the degree d_inf with
    the weights r_inf. The error system of a chain of integrators, dE/dtau = S E + K(e1), is then so too.

    For d_inf = 0 the two terms of q_i coincide, and q_i(s) = s is taken: K is linear. The sum read literally, 2 s, is
    the same K with every l_i twice as large.

    Choosing l: any l_n > 0, then l_n-1, and so on to l_1, each large enough for the part of the system below it.
    For n up to 2 all positive numbers do. From n = 3 on, a linear part that is Hurwitz is not enough for d_inf > 0.
    l_i = 2^(n-i) converges for n up to 4 and every d_inf tried, from errors of 1e-3 to 1e3
    (`tests/papers/test_bi_limit.py`).

    Attributes:
        l: l_1 to l_n, positive; their number is the dimension n.
        d_inf: Degree at infinity, in [0, 1/(n - 1)); the paper's p if n = 2.
    """

    l: tuple[float, ...]  # noqa: E741 - the paper's letter
    d_inf: float = 0.0

    @property
    def n(self) -> int:
        """Dimension."""
        return len(self.l)

    @cached_property
    def exponents(self) -> tuple[float, ...]:
        """r_inf,i+1/r_inf,i for i = 1..n."""
        r = weights(self.n, self.d_inf)
        return tuple(r[i + 1] / r[i] for i in range(self.n))

    def __call__(self, e1: Scalar) -> tuple[Scalar, ...]:
        """Return the n components of K(e1), elementwise."""
        K, s = [], e1
        for l_i, exponent in zip(self.l, self.exponents, strict=True):
            s = l_i * s
            if self.d_inf > 0.0:
                s = s + signed_power(s, exponent)
            K.append(-s)
        return tuple(K)


def largest_b(n: int, d_inf: float, v: Sequence[float] = ()) -> float:
    """Return the bound below which (21) and (22) hold.

    Args:
        n: Dimension.
        d_inf: Degree at infinity.
        v: Exponents v_2..v_n with which Omega grows in the estimate; empty if it does not depend on it.

    Returns:
        The bound on b; infinite if there is none.
    """
    bounds = [math.inf, *_bounds_of_22(v).values()]
    for i, j, ratio in _growth_ratios(n, d_inf):
        if ratio > 1.0:  # ratio < (i + b)/(j - 1 + b), solved for b
            bounds.append((i - ratio * (j - 1)) / (ratio - 1.0))
    return min(bounds)


def list_violations(n: int, d_inf: float, b: float, v: Sequence[float] = ()) -> list[str]:
    """List the inequalities (21), (22), needed by the proof of Theorem 1, that do not hold.

    The second half of (21) holds for every b > 0. Arguments are those of `largest_b`, and the exponent b.
    """
    ratios = _growth_ratios(n, d_inf)
    by_21 = [f"(21) for i = {i}, j = {j}" for i, j, ratio in ratios if not ratio < (i + b) / (j - 1 + b)]
    return by_21 + [f"(22) for j = {j}" for j, bound in _bounds_of_22(v).items() if not b < bound]


def _growth_ratios(n: int, d_inf: float) -> list[tuple[int, int, float]]:
    """Return i, j and the left side of (21), for 1 <= j <= i <= n."""
    r = weights(n, d_inf)
    return [(i, j, r[i] / r[j - 1]) for i in range(1, n + 1) for j in range(1, i + 1)]


def _bounds_of_22(v: Sequence[float]) -> dict[int, float]:
    """Return the right side of (22) by j."""
    return {j: (1.0 - v_j * (j - 1)) / v_j for j, v_j in enumerate(v, start=2) if v_j > 0.0}


# --- The observer ---

Signals = Any
"""Some signals, a tuple or an array of them: floats for one world, arrays (n_worlds,) for many."""

Function = Callable[[Any, Signals, Signals], Scalar]
"""(u, y, (x_2, ..., x_i)) -> a number: f_i. Omega takes (x_2, ..., x_n)."""


@dataclass(frozen=True)
class UpdatedHighGain:
    """x' = S x + f(u, y, x) + L diag(L^b, ..., L^(n+b-1)) K((x_1 - y)/L^b), L' of `updated_gain`: all a_i of (4) are 1.

    One classical Runge-Kutta step a sample, the measurement running straight between samples and the input held;
    L takes its exact solution over each half of the step for the Omega at its beginning.

    Theorem 1 asks for phi1 small and phi2, phi3 large enough: how far depends on constants that only its proof
    bounds. What can be checked is `list_violations`; the paper's own example violates (21) and (22).

    Attributes:
        dt: Sample period [s].
        f: f_1..f_n of (4), each of (u, y, (x_2, ..., x_i)).
        correction: K, with its l and d_inf.
        Omega: Bound on the local incremental rate of f, (9), of (u, y, (x_2, ..., x_n)) [1/s].
        b: Exponent of the scaling.
        phi1: See `updated_gain`.
        phi2: See `updated_gain`; the gain at the start.
        phi3: See `updated_gain`.
        saturate: Limits (y, (x_2, ..., x_n)) to the set in which the system is known to stay, for f_2..f_n and Omega.
            f_1, which takes no estimate, gets y as it is measured.
    """

    dt: float
    f: Sequence[Function]
    correction: BiLimitCorrection
    Omega: Function
    b: float
    phi1: float
    phi2: float
    phi3: float
    saturate: Callable[[Signals, Signals], tuple[Signals, Signals]] = lambda y, x: (y, x)

    def step(self, x: np.ndarray, L: Scalar, y_before: Signals, y: Signals, u: Any) -> tuple[np.ndarray, Scalar]:
        """Advance by one sample period.

        Args:
            x: Estimate at sample k-1, (n, ...).
            L: The gain there.
            y_before: Measurement there.
            y: Measurement at sample k; it ran straight since.
            u: Known inputs, held since.

        Returns:
            Estimate and gain at sample k.
        """
        middle = tuple(0.5 * (p + q) for p, q in zip(y_before, y, strict=True))
        held = self.Omega(u, *self.saturate(y_before, x[1:])), 0.5 * self.dt, self.phi1, self.phi2, self.phi3
        L_middle = updated_gain(L, *held)
        L_end = updated_gain(L_middle, *held)
        stages: dict[float, tuple[Scalar, Signals]] = {0.0: (L, y_before), 0.5: (L_middle, middle), 1.0: (L_end, y)}
        return runge_kutta(lambda share, z: np.array(self.slope(z, *stages[share], u)), x, self.dt), L_end

    def follow(
        self, y: Signals, x: Signals, u: Sequence[Any] | None = None, gain: Scalar = 1.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Estimate from all samples.

        Args:
            y: Measurements, each (n_times, ...): the output, and after it whatever other measured signals f and Omega
                take.
            x: Estimate to start from, x_1..x_n.
            u: Known inputs held from each sample on, (n_times,).
            gain: Gain at the start over phi2.

        Returns:
            Estimates (n, n_times, ...) and gains (n_times, ...).
        """
        samples = list(zip(*y, strict=True))
        zero = 0.0 * samples[0][0]
        estimates, gains = [np.array([x_i + zero for x_i in x])], [gain * (self.phi2 + zero)]
        for k, (before, now) in enumerate(itertools.pairwise(samples)):
            estimate, L = self.step(estimates[-1], gains[-1], before, now, None if u is None else u[k])
            estimates.append(estimate)
            gains.append(L)
        return np.moveaxis(np.array(estimates), 1, 0), np.array(gains)

    def slope(self, x: Signals, L: Scalar, y: Signals, u: Any) -> Signals:
        """Return the right-hand side of (7)."""
        limited_y, limited_x = self.saturate(y, x[1:])
        scale = signed_power(L, self.b)
        slopes = []
        for i, K_i in enumerate(self.correction((x[0] - y[0]) / scale)):
            scale = L * scale  # L^(i + 1 + b)
            f_i = self.f[i](u, limited_y, limited_x[:i]) if i else self.f[0](u, y, ())
            slopes.append(f_i + (x[i + 1] + scale * K_i if i + 1 < len(x) else scale * K_i))
        return tuple(slopes)
