"""The homogeneous finite-time differentiator, aranovskiy2020 (11)."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.elementwise import Scalar, cos, signed_power, sin
from cmg_mj.observers.protocol import CONFIG, Estimate, Measurement, Positive
from cmg_mj.reduced import ReducedModel


class State(NamedTuple):
    """The estimate and the last measurement."""

    x1: Scalar
    x2: Scalar
    y1: Scalar
    y2: Scalar


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
        return State(y.y1, 0.0 * y.y1, y.y1, y.y2)

    def _model(self, y1: Scalar, y2: Scalar, u: Scalar) -> tuple[Scalar, Scalar]:
        """The model's part of x2' as (a, c): a - c x2, so that each measurement is looked up once."""
        m = self.model
        s, c = sin(y2), cos(y2)
        D = m.J1 + m.J2 * s * s
        drive = (u * m.J_d * m.omega_d * c + m.gravity_torque * sin(y1)) / D
        return drive, u * m.J2 * 2.0 * s * c / D

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period."""
        h, k1, k2, alpha = self.dt, self.k1, self.k2, self.alpha
        beta = 2.0 * alpha - 1.0
        x1, x2, y1_before, y2_before = state
        y1, y2 = y
        y1_middle = 0.5 * (y1_before + y1)
        a0, c0 = self._model(y1_before, y2_before, u)
        am, cm = self._model(y1_middle, 0.5 * (y2_before + y2), u)
        a1, c1 = self._model(y1, y2, u)

        e = x1 - y1_before
        p1 = x2 - k1 * signed_power(e, alpha)
        p2 = a0 - c0 * x2 - k2 * signed_power(e, beta)
        w = x2 + 0.5 * h * p2
        e = x1 + 0.5 * h * p1 - y1_middle
        q1 = w - k1 * signed_power(e, alpha)
        q2 = am - cm * w - k2 * signed_power(e, beta)
        w = x2 + 0.5 * h * q2
        e = x1 + 0.5 * h * q1 - y1_middle
        r1 = w - k1 * signed_power(e, alpha)
        r2 = am - cm * w - k2 * signed_power(e, beta)
        w = x2 + h * r2
        e = x1 + h * r1 - y1
        s1 = w - k1 * signed_power(e, alpha)
        s2 = a1 - c1 * w - k2 * signed_power(e, beta)

        x1 = x1 + h / 6.0 * (p1 + 2.0 * (q1 + r1) + s1)
        x2 = x2 + h / 6.0 * (p2 + 2.0 * (q2 + r2) + s2)
        return State(x1, x2, y1, y2), Estimate(x1, x2, y2)
