"""(10) and (11) of aranovskiy2020 by explicit Euler, which Section V's order owes something to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from cmg_mj.core.arrays import Scalar, signed_powers
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import Estimate, Measurement
from cmg_mj.observers.ltv import exact_step, map_of_one
from cmg_mj.papers.aranovskiy2020.paper import TABLE_2


class Ten(NamedTuple):
    """The estimate, and the entries of H that do not stay zero."""

    x1: Scalar
    x2: Scalar
    x3: Scalar
    h11: Scalar
    h12: Scalar
    h22: Scalar
    h33: Scalar


@dataclass(frozen=True)
class TenByEuler:
    """(10), one Euler step a sample at the newest measurement, as `Plain` in matrices.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        exact_gain: Whether H takes the exact step instead, and the estimate alone Euler's.
    """

    dt: float
    model: ReducedModel
    exact_gain: bool = False

    def init(self, y: Measurement) -> Ten:
        """Start at rest, with H = H_0."""
        zero = 0.0 * y.y1
        h11, h22, h33 = TABLE_2["ltv"]["H0"]
        return Ten(y.y1, zero, y.y2, h11 + zero, zero, h22 + zero, h33 + zero)

    def step(self, state: Ten, y: Measurement, u: Scalar) -> tuple[Ten, Estimate]:
        """Advance by one sample period."""
        x1, x2, x3, h11, h12, h22, h33 = state
        dt, (q1, q2, q3) = self.dt, TABLE_2["ltv"]["Q"]
        drift, gain, damping = self.model.terms(*y)
        a = -u * damping
        off1, off3 = x1 - y.y1, x3 - y.y2
        estimate = Estimate(
            x1 + dt * (x2 - h11 * off1),
            x2 + dt * (a * x2 + drift + u * gain - h12 * off1),
            x3 + dt * (u - h33 * off3),
        )
        if self.exact_gain:
            up, down = map_of_one(q3, dt)
            # Two halves: the series of the exact step wants a short one.
            for _ in range(2):
                h11, h12, h22 = exact_step(h11, h12, h22, q1, q2, a, dt / 2.0)
            return Ten(*estimate, h11, h12, h22, (h33 + up) / (down * h33 + 1.0)), estimate
        return Ten(
            *estimate,
            h11 + dt * (2.0 * h12 - h11 * h11 + q1),
            h12 + dt * (h22 + a * h12 - h11 * h12),
            h22 + dt * (2.0 * a * h22 - h12 * h12 + q2),
            h33 + dt * (q3 - h33 * h33),
        ), estimate


class Eleven(NamedTuple):
    """The estimate."""

    x1: Scalar
    x2: Scalar


@dataclass(frozen=True)
class ElevenByEuler:
    """(11), one Euler step a sample at the newest measurement.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
    """

    dt: float
    model: ReducedModel

    def init(self, y: Measurement) -> Eleven:
        """Start at rest at the measured tilt."""
        return Eleven(y.y1, 0.0 * y.y1)

    def step(self, state: Eleven, y: Measurement, u: Scalar) -> tuple[Eleven, Estimate]:
        """Advance by one sample period."""
        x1, x2 = state
        k1, k2, alpha = TABLE_2["homogeneous"].values()
        drift, gain, damping = self.model.terms(*y)
        by_alpha, by_other = signed_powers(x1 - y.y1, alpha)
        estimate = Eleven(
            x1 + self.dt * (x2 - k1 * by_alpha),
            x2 + self.dt * (drift + u * (gain - damping * x2) - k2 * by_other),
        )
        return estimate, Estimate(estimate.x1, estimate.x2, y.y2)
