"""The homogeneous finite-time differentiator, aranovskiy2020 (11)."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.elementwise import Scalar, signed_powers
from cmg_mj.observers.protocol import CONFIG, Estimate, Measurement, Positive
from cmg_mj.reduced import ReducedModel


class State(NamedTuple):
    """The estimate, the last measurement, and the model's terms there."""

    x1: Scalar
    x2: Scalar
    y: Measurement
    terms: tuple[Scalar, Scalar, Scalar]


@dataclass(frozen=True, config=CONFIG)
class Homogeneous:
    """x1' = x2 - k1 [e]^alpha, x2' = f2(y, x2, u) - k2 [e]^(2 alpha - 1), e = x1 - y1, [e]^a = |e|^a sign e.

    One classical Runge-Kutta step a sample, the measurement running straight between samples and the input held.
    The right-hand side is steep at e = 0 only below 1e-9 rad, far under any sensor's noise, so nothing chatters.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        k1: First gain. Default: Table 2.
        k2: Second gain. Default: Table 2. (s^2 + k1 s + k2 is Hurwitz for all positive gains.)
        alpha: Exponent in (1/2, 1]. Default: Table 2.
    """

    dt: Positive
    model: ReducedModel
    k1: Positive = 20.0
    k2: Positive = 150.0
    alpha: Annotated[float, Field(gt=0.5, le=1.0)] = 0.85

    def init(self, y: Measurement) -> State:
        """Start at rest at the measured tilt."""
        return State(y.y1, 0.0 * y.y1, y, self.model.terms(*y))

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period."""
        h, k1, k2, alpha = self.dt, self.k1, self.k2, self.alpha
        x1, x2, (y1_before, y2_before), (drift, gain, damping) = state
        y1, y2 = y
        y1_middle = 0.5 * (y1_before + y1)
        middle = self.model.terms(y1_middle, 0.5 * (y2_before + y2))
        end = self.model.terms(y1, y2)

        e_alpha, e_beta = signed_powers(x1 - y1_before, alpha)
        p1 = x2 - k1 * e_alpha
        p2 = drift + u * (gain - damping * x2) - k2 * e_beta

        drift, gain, damping = middle
        w = x2 + 0.5 * h * p2
        e_alpha, e_beta = signed_powers(x1 + 0.5 * h * p1 - y1_middle, alpha)
        q1 = w - k1 * e_alpha
        q2 = drift + u * (gain - damping * w) - k2 * e_beta

        w = x2 + 0.5 * h * q2
        e_alpha, e_beta = signed_powers(x1 + 0.5 * h * q1 - y1_middle, alpha)
        r1 = w - k1 * e_alpha
        r2 = drift + u * (gain - damping * w) - k2 * e_beta

        drift, gain, damping = end
        w = x2 + h * r2
        e_alpha, e_beta = signed_powers(x1 + h * r1 - y1, alpha)
        s1 = w - k1 * e_alpha
        s2 = drift + u * (gain - damping * w) - k2 * e_beta

        x1 = x1 + h / 6.0 * (p1 + 2.0 * (q1 + r1) + s1)
        x2 = x2 + h / 6.0 * (p2 + 2.0 * (q2 + r2) + s2)
        return State(x1, x2, y, end), Estimate(x1, x2, y2)
