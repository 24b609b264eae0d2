"""The correction term of andrieu2009: a vector field K that is homogeneous in the bi-limit, for any dimension.

V. Andrieu, L. Praly, A. Astolfi, "High gain observers with updated gain and homogeneous correction terms",
Automatica 45 (2009). The construction of K is that of their "Homogeneous approximation, recursive observer design, and
output feedback", SIAM Journal on Control and Optimization 47 (2008); for n = 2 it gives the q1, q2 of the 2009 paper's
example.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar, signed_power
from cmg_mj.core.errors import InputError, shown
from cmg_mj.observers.high_gain import updated_gain
from cmg_mj.observers.model_copy import require_stable_step
from cmg_mj.papers.require import require_number, require_positive

# --- The correction term of andrieu2009 ---


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


# --- The high-gain observer with updated gain and homogeneous correction, andrieu2009 (7)-(10), in its general ---

Signals = tuple[Scalar, ...]
"""Some signals: floats for one world, arrays (n_worlds,) for many."""

Function = Callable[[Any, Signals, Signals], Scalar]
"""(u, y, (x_2, ..., x_i)) -> a number: f_i. Omega takes (x_2, ..., x_n)."""

Saturate = Callable[[Signals, Signals], tuple[Signals, Signals]]
"""(y, (x_2, ..., x_n)) -> the same, limited to the set in which the system is known to stay."""


class State(NamedTuple):
    """The estimate x_1..x_n, the gain, and the measurement of the last sample."""

    x: Signals
    L: Scalar
    y: Signals


def _pass_through(y: Signals, x: Signals) -> tuple[Signals, Signals]:
    return y, x


@dataclass(frozen=True)
class UpdatedHighGain:
    """x' = A(y) S x + f(u, y, x) + L diag(L^b, ..., L^(n+b-1)) A(y) K((x_1 - y)/L^b), with L' of `updated_gain`.

    One classical Runge-Kutta step a sample, the measurement running straight between samples and the input held;
    L takes its exact solution over each half of the step for the Omega at its beginning.

    Theorem 1 asks for phi1 small and phi2, phi3 large enough: how far depends on constants that only its proof
    bounds, so they are the user's to choose. What can be checked is `list_violations`; the paper's own example
    violates them, so that they are refused only on demand. Where all a_i are 1, gains are refused with which the
    linear part is unstable in a Runge-Kutta step at the gain at the start; how large L gets depends on Omega.

    Attributes:
        dt: Sample period [s].
        f: f_1..f_n of (4), each of (u, y, (x_2, ..., x_i)).
        correction: K, with its l and d_inf.
        Omega: Bound on the local incremental rate of f, (9), of (u, y, (x_2, ..., x_n)) [1/s].
        b: Exponent of the scaling.
        phi1: See `updated_gain`.
        phi2: See `updated_gain`.
        phi3: See `updated_gain`.
        a: a_1..a_n of (4), (5), positive functions of y; all 1 if left out.
        v: Exponents v_2..v_n with which Omega grows in the estimate, for (22); empty if its arguments are limited.
        saturate: Limits the arguments of f_2..f_n and of Omega. f_1, which takes no estimate, gets y as it is measured.
        L0: Gain at the start, at least phi2; phi2 if left out.
        strict: Whether to refuse a b for which (21) or (22) does not hold.
    """

    dt: float
    f: tuple[Function, ...]
    correction: BiLimitCorrection
    Omega: Function
    b: float
    phi1: float
    phi2: float
    phi3: float
    a: tuple[Callable[[Signals], Scalar], ...] = ()
    v: tuple[float, ...] = ()
    saturate: Saturate = _pass_through
    L0: float | None = None
    strict: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.correction, BiLimitCorrection):
            raise InputError(f"correction = {shown(self.correction)}: must be a BiLimitCorrection")
        n = self.correction.n
        for name in ("dt", "b", "phi1", "phi2", "phi3"):
            object.__setattr__(self, name, require_positive(name, getattr(self, name)))
        for name, lengths in (("f", (n,)), ("a", (0, n)), ("v", (0, n - 1))):
            elements = getattr(self, name)
            if not isinstance(elements, Sequence | np.ndarray):
                kind = "numbers" if name == "v" else "functions"
                raise InputError(f"{name} = {shown(elements)}: must be a tuple of {lengths[-1]} {kind}")
            if len(elements) not in lengths:
                raise InputError(f"{name}: has {len(elements)} elements, but l says n = {n}: must have {lengths[-1]}")
            object.__setattr__(self, name, tuple(elements))
        self._check_functions()
        for j, v_j in enumerate(self.v, start=2):
            if not 0.0 <= require_number(f"v_{j}", v_j) < 1.0 / (j - 1):
                raise InputError(f"v_{j} = {v_j:g}: must be in [0, 1/(j - 1)) = [0, {1.0 / (j - 1):g}) (Theorem 1)")
        if self.L0 is not None:
            object.__setattr__(self, "L0", require_number("L0", self.L0))
            if not self.phi2 <= self.L0 < math.inf:
                raise InputError(f"L0 = {self.L0:g}: must be at least phi2 = {self.phi2:g} (Theorem 1)")
        if not self.a:
            names = "l, phi2" if self.L0 is None else "l, L0"
            poles = np.roots([1.0, *self.correction.linear_gains])
            require_stable_step(names, (self.L0 or self.phi2) * poles, self.dt)
        if self.strict and (violations := self.list_violations()):
            raise InputError(f"b = {self.b:g}: {'; '.join(violations)} (Theorem 1)")

    def _check_functions(self) -> None:
        """Refuse what cannot be called."""
        indexed = [(f"{name}_{i}", g) for name in "fa" for i, g in enumerate(getattr(self, name), start=1)]
        for name, function in (*indexed, ("Omega", self.Omega), ("saturate", self.saturate)):
            if not callable(function):
                raise InputError(f"{name} = {shown(function)}: must be a function")

    @classmethod
    def plain(cls, *, dt: float, f: Sequence[Function], l: Sequence[float], L: float, **extras: Any) -> UpdatedHighGain:  # noqa: E741
        """Make the classical high-gain observer: linear correction, constant gain.

        Args:
            dt: Sample period [s].
            f: f_1..f_n.
            l: l_1..l_n.
            L: The gain.
            **extras: a, saturate.

        Returns:
            The observer with d_inf = 0 and Omega = 0. With a linear K, b is without effect.
        """
        correction = BiLimitCorrection(tuple(l))
        return cls(dt, tuple(f), correction, lambda u, y, x: 0.0 * y[0], 1.0, 1.0, L, 1.0, **extras)

    @classmethod
    def updated(
        cls,
        *,
        dt: float,
        f: Sequence[Function],
        l: Sequence[float],  # noqa: E741
        Omega: Function,
        phi1: float,
        phi2: float,
        phi3: float,
        v: Sequence[float] = (),
        **extras: Any,
    ) -> UpdatedHighGain:
        """Make the updated high-gain observer: linear correction, gain by (8).

        Args:
            dt: Sample period [s].
            f: f_1..f_n.
            l: l_1..l_n.
            Omega: Bound on the local incremental rate [1/s].
            phi1: See `updated_gain`.
            phi2: See `updated_gain`.
            phi3: See `updated_gain`.
            v: Exponents with which Omega grows.
            **extras: a, saturate, L0.

        Returns:
            The observer with d_inf = 0. With a linear K, b is without effect; it is chosen to satisfy (22).
        """
        b = min(1.0, 0.5 * largest_b(len(l), 0.0, v))
        return cls(dt, tuple(f), BiLimitCorrection(tuple(l)), Omega, b, phi1, phi2, phi3, v=tuple(v), **extras)

    def list_violations(self) -> list[str]:
        """List the inequalities (21), (22) that do not hold."""
        return list_violations(self.correction.n, self.correction.d_inf, self.b, self.v)

    def init(self, y: Signals, x: Signals | None = None) -> State:
        """Return the state at the first sample.

        Args:
            y: Measurement: the output, and after it whatever other measured signals f, a and Omega take.
            x: Estimate to start from, x_1..x_n; (y, 0, ..., 0) if left out.

        Returns:
            The state, with L = L0.

        Raises:
            InputError: y or x is no tuple, or x has not n elements.
        """
        for name, signals in (("y", y), ("x", (0.0,) if x is None else x)):
            if np.ndim(signals) == 0 or len(signals) == 0:
                raise InputError(f"{name} = {shown(signals)}: must be a tuple of signals, such as (0.1,)")
        if x is not None and len(x) != self.correction.n:
            raise InputError(f"x: has {len(x)} elements, but l says n = {self.correction.n}")
        zero = 0.0 * y[0]
        start = (y[0], *[zero] * (self.correction.n - 1)) if x is None else tuple(x_i + zero for x_i in x)
        return State(start, (self.phi2 if self.L0 is None else self.L0) + zero, tuple(y))

    def step(self, state: State, y: Signals, u: Any) -> tuple[State, Signals]:
        """Advance by one sample period.

        Args:
            state: The state at sample k-1.
            y: Measurement at sample k; it ran straight since sample k-1.
            u: Known inputs, held since sample k-1.

        Returns:
            The state and the estimate x_1..x_n at sample k.
        """
        h, (x, L, y_before) = self.dt, state
        middle = tuple(0.5 * (p + q) for p, q in zip(y_before, y, strict=True))
        Omega = self._incremental_rate(u, y_before, x)
        L_middle = updated_gain(L, Omega, 0.5 * h, self.phi1, self.phi2, self.phi3)
        L_end = updated_gain(L_middle, Omega, 0.5 * h, self.phi1, self.phi2, self.phi3)

        p = self.slope(x, L, y_before, u)
        q = self.slope(_advance(x, 0.5 * h, p), L_middle, middle, u)
        r = self.slope(_advance(x, 0.5 * h, q), L_middle, middle, u)
        s = self.slope(_advance(x, h, r), L_end, y, u)
        x = tuple(
            x_i + h / 6.0 * (p_i + 2.0 * (q_i + r_i) + s_i)
            for x_i, p_i, q_i, r_i, s_i in zip(x, p, q, r, s, strict=True)
        )
        return State(x, L_end, tuple(y)), x

    def slope(self, x: Signals, L: Scalar, y: Signals, u: Any) -> Signals:
        """Return the right-hand side of (7)."""
        n = self.correction.n
        limited_y, limited_x = self.saturate(y, x[1:])
        scale = signed_power(L, self.b)
        K = self.correction((x[0] - y[0]) / scale)
        slopes = []
        for i in range(n):
            scale = L * scale  # L^(i + 1 + b)
            f_i = self.f[i](u, limited_y, limited_x[:i]) if i else self.f[0](u, y, ())
            chain_term = x[i + 1] + scale * K[i] if i + 1 < n else scale * K[i]
            slopes.append(f_i + (self.a[i](y) * chain_term if self.a else chain_term))
        return tuple(slopes)

    def _incremental_rate(self, u: Any, y: Signals, x: Signals) -> Scalar:
        limited_y, limited_x = self.saturate(y, x[1:])
        return self.Omega(u, limited_y, limited_x)


def _advance(x: Signals, span: float, slope: Signals) -> Signals:
    """Return the point x + span slope."""
    return tuple(x_i + span * slope_i for x_i, slope_i in zip(x, slope, strict=True))
