"""Levant's robust exact differentiator, reference [12] of aranovskiy2020.

A. Levant, "Robust exact differentiation via sliding mode technique", Automatica 34 (1998).
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip, sign, sqrt, where
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.inputs.types import STRICT, Positive


class State(NamedTuple):
    """Estimates of the tilt and its rate."""

    z0: Scalar
    z1: Scalar


@dataclass(frozen=True, config=STRICT)
class SuperTwisting:
    """Levant's robust exact differentiator, reference [12] of aranovskiy2020.

    z0' = z1 - l0 sqrt(L) |s|^(1/2) sign s, z1' = -l1 L sign s, s = z0 - y1: model-free.

    Discretised implicitly, because an explicit step chatters with an amplitude of order L dt: with h = dt and
    b = z0 + h z1 - y1, the sliding variable after the step solves
    s + h l0 sqrt(L) |s|^(1/2) sign s + h^2 l1 L sign s = b, sign being the set-valued one. Where
    |b| <= h^2 l1 L its solution is s = 0.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used: this observer is model-free).
        L: Bound on the size of the tilt's second derivative [rad/s^2]. Default: tuned, docs/assumptions.md.
        l0: Gain of the tilt's correction. Default: Levant's 1.5.
        l1: Gain of the rate's correction. Default: Levant's 1.1.
    """

    needs: ClassVar[tuple[str, ...]] = ()

    dt: Positive
    model: ReducedModel
    L: Positive = 10.4
    l0: Positive = 1.5
    l1: Positive = 1.1

    def init(self, y: Measurement) -> State:
        """Start at rest at the measured tilt."""
        return State(y.y1, 0.0 * y.y1)

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period."""
        h = self.dt
        z0, z1 = state
        y1, y2 = y
        b = z0 + h * z1 - y1
        root = h * self.l0 * self.L**0.5
        jump = h * h * self.l1 * self.L
        switched = clip(b / jump, -1.0, 1.0)  # the selection of sign s that solves the inclusion
        beyond = where(abs(b) > jump, abs(b) - jump, 0.0 * b)
        half = (sqrt(root * root + 4.0 * beyond) - root) / 2.0  # |s|^(1/2)
        z1 = z1 - h * self.l1 * self.L * switched
        z0 = y1 + half * half * sign(b)
        return State(z0, z1), Estimate(z0, z1, y2)
