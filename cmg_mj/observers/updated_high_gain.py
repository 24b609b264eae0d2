"""The high-gain observer with updated gain and homogeneous correction, andrieu2009 (7)-(10), in its general form.

For systems (4): x_i' = f_i(u, y, x_2..x_i) + a_i(y) x_i+1, y = x_1. The rig's own observer is `high_gain.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from cmg_mj.elementwise import Scalar, clip, exp, signed_power
from cmg_mj.errors import InputError
from cmg_mj.observers.bi_limit import BiLimitCorrection, largest_b, require_positive, violated_conditions

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


def updated_gain(L: Scalar, Omega: Scalar, span: float, phi1: float, phi2: float, phi3: float) -> Scalar:
    """Advance L' = L (phi1 (phi2 - L) + phi3 Omega), (8), exactly for an Omega >= 0 held over the span.

    The solution of this logistic equation stays at or above phi2 whatever the span, and at phi2 if Omega is 0.

    Args:
        L: The gain, at least phi2.
        Omega: Bound on the local incremental rate [1/s].
        span: Time to advance [s].
        phi1: Rate with which L returns, per unit of L [1/s].
        phi2: Least gain.
        phi3: Weight of Omega.

    Returns:
        The gain afterwards.
    """
    growth = phi1 * phi2 + phi3 * Omega
    decay = exp(-growth * span)
    rest = phi1 * L
    return clip(L + L * (growth - rest) * (1.0 - decay) / (rest * (1.0 - decay) + growth * decay), phi2, math.inf)


def _unlimited(y: Signals, x: Signals) -> tuple[Signals, Signals]:
    return y, x


@dataclass(frozen=True)
class UpdatedHighGain:
    """x' = A(y) S x + f(u, y, x) + L diag(L^b, ..., L^(n+b-1)) A(y) K((x_1 - y)/L^b), with L' of `updated_gain`.

    One classical Runge-Kutta step a sample, the measurement running straight between samples and the input held;
    L takes its exact solution over each half of the step for the Omega at its beginning.

    Theorem 1 asks for phi1 small and phi2, phi3 large enough: how far depends on constants that only its proof
    bounds, so they are the user's to choose. What can be checked is `violated_conditions`.

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
    saturate: Saturate = _unlimited
    L0: float | None = None

    def __post_init__(self) -> None:
        n = self.correction.n
        for name in ("dt", "b", "phi1", "phi2", "phi3"):
            require_positive(name, getattr(self, name))
        for name, given, allowed in (("f", self.f, (n,)), ("a", self.a, (0, n)), ("v", self.v, (0, n - 1))):
            if len(given) not in allowed:
                raise InputError(f"{name}: has {len(given)} elements, but l says n = {n}: must have {allowed[-1]}")
        for j, v_j in enumerate(self.v, start=2):
            if not 0.0 <= v_j < 1.0 / (j - 1):
                raise InputError(f"v_{j} = {v_j:g}: must be in [0, 1/(j - 1)) = [0, {1.0 / (j - 1):g}) (Theorem 1)")
        if self.L0 is not None and not self.phi2 <= self.L0 < math.inf:
            raise InputError(f"L0 = {self.L0:g}: must be at least phi2 = {self.phi2:g} (Theorem 1)")

    @classmethod
    def plain(cls, *, dt: float, f: Sequence[Function], l: Sequence[float], L: float, **others: Any) -> UpdatedHighGain:  # noqa: E741
        """The classical high-gain observer: linear correction, constant gain.

        Args:
            dt: Sample period [s].
            f: f_1..f_n.
            l: l_1..l_n.
            L: The gain.
            **others: a, saturate.

        Returns:
            The observer with d_inf = 0 and Omega = 0. With a linear K, b is without effect.
        """
        correction = BiLimitCorrection(tuple(l))
        return cls(dt, tuple(f), correction, lambda u, y, x: 0.0 * y[0], 1.0, 1.0, L, 1.0, **others)

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
        **others: Any,
    ) -> UpdatedHighGain:
        """The updated high-gain observer: linear correction, gain by (8).

        Args:
            dt: Sample period [s].
            f: f_1..f_n.
            l: l_1..l_n.
            Omega: Bound on the local incremental rate [1/s].
            phi1: See `updated_gain`.
            phi2: See `updated_gain`.
            phi3: See `updated_gain`.
            v: Exponents with which Omega grows.
            **others: a, saturate, L0.

        Returns:
            The observer with d_inf = 0. With a linear K, b is without effect; it is chosen to satisfy (22).
        """
        b = min(1.0, 0.5 * largest_b(len(l), 0.0, v))
        return cls(dt, tuple(f), BiLimitCorrection(tuple(l)), Omega, b, phi1, phi2, phi3, v=tuple(v), **others)

    def violated_conditions(self) -> list[str]:
        """A line for each of the inequalities (21), (22) that does not hold."""
        return violated_conditions(self.correction.n, self.correction.d_inf, self.b, self.v)

    def init(self, y: Signals, x: Signals | None = None) -> State:
        """The state at the first sample.

        Args:
            y: What is measured: the output, and after it whatever other measured signals f, a and Omega take.
            x: Estimate to start from, x_1..x_n; (y, 0, ..., 0) if left out.

        Returns:
            The state, with L = L0.
        """
        zero = 0.0 * y[0]
        start = (y[0], *[zero] * (self.correction.n - 1)) if x is None else tuple(x_i + zero for x_i in x)
        return State(start, (self.phi2 if self.L0 is None else self.L0) + zero, tuple(y))

    def step(self, state: State, y: Signals, u: Any) -> tuple[State, Signals]:
        """Advance by one sample period.

        Args:
            state: The state at sample k-1.
            y: What is measured at sample k; it ran straight since sample k-1.
            u: Known inputs, held since sample k-1.

        Returns:
            The state and the estimate x_1..x_n at sample k.
        """
        h, (x, L, before) = self.dt, state
        middle = tuple(0.5 * (p + q) for p, q in zip(before, y, strict=True))
        Omega = self._rate(u, before, x)
        L_middle = updated_gain(L, Omega, 0.5 * h, self.phi1, self.phi2, self.phi3)
        L_end = updated_gain(L_middle, Omega, 0.5 * h, self.phi1, self.phi2, self.phi3)

        p = self.slope(x, L, before, u)
        q = self.slope(_moved(x, 0.5 * h, p), L_middle, middle, u)
        r = self.slope(_moved(x, 0.5 * h, q), L_middle, middle, u)
        s = self.slope(_moved(x, h, r), L_end, y, u)
        x = tuple(
            x_i + h / 6.0 * (p_i + 2.0 * (q_i + r_i) + s_i)
            for x_i, p_i, q_i, r_i, s_i in zip(x, p, q, r, s, strict=True)
        )
        return State(x, L_end, tuple(y)), x

    def slope(self, x: Signals, L: Scalar, y: Signals, u: Any) -> Signals:
        """The right-hand side of (7)."""
        n = self.correction.n
        limited_y, limited_x = self.saturate(y, x[1:])
        scale = signed_power(L, self.b)
        K = self.correction((x[0] - y[0]) / scale)
        slopes = []
        for i in range(n):
            scale = L * scale  # L^(i + 1 + b)
            known = self.f[i](u, limited_y, limited_x[:i]) if i else self.f[0](u, y, ())
            along = x[i + 1] + scale * K[i] if i + 1 < n else scale * K[i]
            slopes.append(known + (self.a[i](y) * along if self.a else along))
        return tuple(slopes)

    def _rate(self, u: Any, y: Signals, x: Signals) -> Scalar:
        limited_y, limited_x = self.saturate(y, x[1:])
        return self.Omega(u, limited_y, limited_x)


def _moved(x: Signals, span: float, slope: Signals) -> Signals:
    """The point x + span slope."""
    return tuple(x_i + span * slope_i for x_i, slope_i in zip(x, slope, strict=True))
