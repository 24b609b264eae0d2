"""The correction term of andrieu2009: a vector field K that is homogeneous in the bi-limit, for any dimension.

V. Andrieu, L. Praly, A. Astolfi, "High gain observers with updated gain and homogeneous correction terms",
Automatica 45 (2009). The construction of K is that of their "Homogeneous approximation, recursive observer design, and
output feedback", SIAM Journal on Control and Optimization 47 (2008); for n = 2 it gives the q1, q2 of the 2009 paper's
example.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmg_mj.core.arrays import Scalar, signed_power
from cmg_mj.core.errors import InputError
from cmg_mj.papers.require import require_number, require_positive


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
    For n up to 2 all positive numbers do. From n = 3 on, a linear part that is Hurwitz, which is checked, is not enough
    for d_inf > 0. l_i = 2^(n-i) converges for n up to 4 and every d_inf tried, from errors of 1e-3 to 1e3
    (`tests/papers/test_bi_limit.py`).

    Attributes:
        l: l_1 to l_n, whose number is the dimension n. Positive, and such that the linear part of K is Hurwitz.
        d_inf: Degree at infinity, in [0, 1/(n - 1)); the paper's p if n = 2.
    """

    l: tuple[float, ...]  # noqa: E741 - the paper's letter
    d_inf: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.l, Sequence | np.ndarray) or len(self.l) == 0:
            raise InputError("l: must have one number a dimension, at least one")
        n = len(self.l)
        object.__setattr__(self, "l", tuple(require_positive(f"l_{i}", v) for i, v in enumerate(self.l, start=1)))
        object.__setattr__(self, "d_inf", require_number("d_inf", self.d_inf))
        limit = 1.0 / (n - 1) if n > 1 else math.inf
        if not 0.0 <= self.d_inf < limit:
            raise InputError(
                f"d_inf = {self.d_inf:g}: must be in [0, 1/(n - 1)) = [0, {limit:g}) for n = {n} (Theorem 1)"
            )
        roots = np.roots([1.0, *self.linear_gains])
        if roots.real.max() > -1e-12 * np.abs(roots).max():  # the roots of a marginal case come with rounding errors
            root_list = ", ".join(f"{root:.3g}" for root in roots)
            raise InputError(
                "l: s^n + l_1 s^(n-1) + l_1 l_2 s^(n-2) + ... + l_1...l_n, the linear part of K, must be Hurwitz; "
                f"its roots are {root_list}"
            )

    @property
    def n(self) -> int:
        """Dimension."""
        return len(self.l)

    @property
    def linear_gains(self) -> list[float]:
        """l_1, l_1 l_2, ..., l_1...l_n: minus the slopes of K at 0."""
        return np.cumprod(self.l).tolist()

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
    bounds = [math.inf]
    for i, j, ratio in _growth_ratios(n, d_inf):
        if ratio > 1.0:  # ratio < (i + b)/(j - 1 + b), solved for b
            bounds.append((i - ratio * (j - 1)) / (ratio - 1.0))
    bounds += [(1.0 - v_j * (j - 1)) / v_j for j, v_j in enumerate(v, start=2) if v_j > 0.0]
    return min(bounds)


def list_violations(n: int, d_inf: float, b: float, v: Sequence[float] = ()) -> list[str]:
    """List the inequalities (21), (22), needed by the proof of Theorem 1, that do not hold.

    Args:
        n: Dimension.
        d_inf: Degree at infinity.
        b: Exponent of the scaling.
        v: Exponents v_2..v_n with which Omega grows in the estimate; empty if it does not depend on it.

    Returns:
        A line for each inequality that does not hold. The second half of (21) holds for every b > 0.
    """
    lines = []
    for i, j, ratio in _growth_ratios(n, d_inf):
        bound = (i + b) / (j - 1 + b)
        if not ratio < bound:
            lines.append(
                f"(21) for i = {i}, j = {j}: (1 - d_inf (n - i - 1))/(1 - d_inf (n - j)) = {ratio:.4g} "
                f"is not below (i + b)/(j - 1 + b) = {bound:.4g}"
            )
    for j, v_j in enumerate(v, start=2):
        if v_j > 0.0 and not b < (1.0 - v_j * (j - 1)) / v_j:
            lines.append(
                f"(22) for j = {j}: b = {b:.4g} is not below (1 - v_j (j - 1))/v_j = {(1.0 - v_j * (j - 1)) / v_j:.4g}"
            )
    return lines


def _growth_ratios(n: int, d_inf: float) -> list[tuple[int, int, float]]:
    """Return i, j and the left side of (21), for 1 <= j <= i <= n."""
    r = weights(n, d_inf)
    return [(i, j, r[i] / r[j - 1]) for i in range(1, n + 1) for j in range(1, i + 1)]
