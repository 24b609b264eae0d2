"""The high-gain observer with updated gain and homogeneous correction, andrieu2009 (7)-(10), on the scissored pair."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip, exp, signed_power
from cmg_mj.core.reduced_model import ReducedModel, Terms
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.inputs.types import STRICT, Positive
from cmg_mj.observers.model_copy import follow, require_stable_step, stages

GIMBAL_RATE = 0.4
"""Gimbal rate at which L must still be small enough for the sample period [rad/s]. A slow one: at a faster one a
phi3/phi1 that is taken may still be too large."""


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


class State(NamedTuple):
    """The estimate, the gain, the last measurement, and the model's terms there."""

    x1: Scalar
    x2: Scalar
    L: Scalar
    y: Measurement
    terms: Terms


@dataclass(frozen=True, config=STRICT)
class HighGain:
    """The high-gain observer with updated gain and homogeneous correction, andrieu2009 (7)-(10), on the scissored pair.

    x1' = x2 - L^(1+b) q1(s), x2' = f2(y, x2, u) - L^(2+b) q2(l2 q1(s)), s = l1 (x1 - y1)/L^b, L' by (8).

    q1(w) = w + [w]^(1/(1-d_inf)), q2(w) = w + [w]^(1+d_inf); both w alone if d_inf = 0. Theorem 1's observer written
    out for n = 2 and f2 of the reduced model, one step a sample as there. L starts at phi2.

    f2 is affine in x2, so the bound (9) on its increments is Omega = |u damping|, exactly and with c_inf = 0. On this
    rig it stays below 0.01 1/s, against rates of 10 1/s and more of the observer: the update of the gain has nothing
    to do here.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        l1: Gain of the tilt's correction, which L multiplies [1/s]. Default: docs/studies/tune_high_gain.py, as are
            l2, d_inf and b.
        l2: Ratio of the rate's gain to l1, which L multiplies [1/s]. All positive l1, l2 are stable.
        d_inf: Degree at infinity, the paper's p; 0 makes the corrections linear.
        b: Exponent of L in the scaling, below (1 - d_inf)/d_inf by (21). With phi2 = 1 it matters only while L moves.
        phi1: Rate at which the gain L returns, per unit of L; see `updated_gain`. Default: andrieu2009 section 3.1, as
            are phi2 and phi3.
        phi2: Least value of the gain L; see `updated_gain`.
        phi3: Weight of the local incremental rate, which makes L rise; see `updated_gain`.
    """

    dt: Positive
    model: ReducedModel
    l1: Positive = 29.5
    l2: Positive = 12.4
    d_inf: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.6
    b: Positive = 0.333
    phi1: Positive = 0.03
    phi2: Positive = 1.0
    phi3: Positive = 3.0

    def __post_init__(self) -> None:
        bound = (1.0 - self.d_inf) / self.d_inf if self.d_inf else math.inf
        if not self.b < bound:
            raise ValueError(f"b = {self.b:g}: must be below (1 - d_inf)/d_inf = {bound:.4g}, andrieu2009 (21)")
        poles = np.roots([1.0, self.l1, self.l1 * self.l2])
        require_stable_step("l1, l2, phi2", self.phi2 * poles, self.dt)
        ratio = self.phi3 / self.phi1
        L = self.phi2 + ratio * GIMBAL_RATE * self.largest_damping
        too_large = f"phi3/phi1 = {ratio:.3g}, with which L rises to {L:.3g} at a gimbal rate of {GIMBAL_RATE:g} rad/s"
        require_stable_step(too_large, L * poles, self.dt)

    @property
    def largest_damping(self) -> float:
        """The largest |J2 sin(2 x3)/D| over all gimbal angles."""
        J1, J2 = self.model.J1, self.model.J2
        return abs(J2) / math.sqrt(J1 * (J1 + J2))

    def init(self, y: Measurement) -> State:
        """Start at rest at the measured tilt."""
        zero = 0.0 * y.y1
        return State(y.y1, zero, self.phi2 + zero, y, self.model.terms(*y))

    def correction(self, e: Scalar, L: Scalar) -> tuple[Scalar, Scalar]:
        """L^(1+b) q1(s), L^(2+b) q2(l2 q1(s)) with s = l1 e/L^b."""
        scale = signed_power(L, self.b)
        s = self._with_power(self.l1 * e / scale, 1.0 / (1.0 - self.d_inf))
        return L * scale * s, L * (L * scale) * self._with_power(self.l2 * s, 1.0 + self.d_inf)

    def _with_power(self, w: Scalar, exponent: float) -> Scalar:
        """q1 or q2."""
        return w + signed_power(w, exponent) if self.d_inf else w

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period."""
        x1, x2, L, before, terms = state
        begin, middle, end, after = stages(self.model, before, terms, y, u)
        Omega, half = abs(u * terms[2]), 0.5 * self.dt
        phi = self.phi1, self.phi2, self.phi3
        L_middle = updated_gain(L, Omega, half, *phi)
        L_end = updated_gain(L_middle, Omega, half, *phi)
        x1, x2 = follow(self.correction, x1, x2, self.dt, begin, middle, end, (L, L_middle, L_end))
        return State(x1, x2, L_end, y, after), Estimate(x1, x2, y[1])
