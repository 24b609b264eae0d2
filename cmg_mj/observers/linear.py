"""Differentiators of the measured tilt, without a model: linear filters, the plain difference, and Levant's.

[11] and [13] of aranovskiy2020 are Spong, Corke, Lozano 2001 and L. K. Vasiljevic and H. K. Khalil, "Error bounds in
differentiation of noisy signals by high-gain observers", Systems & Control Letters 57 (2008); [12] is A. Levant,
"Robust exact differentiation via sliding mode technique", Automatica 34 (1998).
"""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip, sign, sqrt, where
from cmg_mj.core.reduced_model import Coefficients, FilterState, ReducedModel, second_order_rows, second_order_step
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.inputs.types import STRICT, Positive


@dataclass(frozen=True, config=STRICT)
class _ModelFree:
    needs: ClassVar[tuple[str, ...]] = ()

    dt: Positive
    model: ReducedModel


class _LinearFilter(_ModelFree):
    """A linear filter of second order, discretised exactly for a measurement that runs straight between samples."""

    @property
    def equations(self) -> tuple[list[list[float]], list[list[float]]]:
        """A, B of z' = A z + B y1; z1 is the tilt and z2 its rate."""
        raise NotImplementedError

    @cached_property
    def _rows(self) -> Coefficients:
        A, B = self.equations
        return second_order_rows(np.array(A), np.array(B), self.dt)

    def init(self, y: Measurement) -> FilterState:
        """Start at rest at the measured tilt."""
        return FilterState(y.y1, 0.0 * y.y1, y.y1)

    def step(self, state: FilterState, y: Measurement, u: Scalar) -> tuple[FilterState, Estimate]:
        """Advance by one sample period."""
        state = second_order_step(self._rows, state, y[0])
        return state, Estimate(state[0], state[1], y[1])


@dataclass(frozen=True, config=STRICT)
class LinearDifferentiator(_LinearFilter):
    """The linear differentiator, aranovskiy2020 (9).

    G(s) = s/(tau s + 1)^2: model-free, aranovskiy2020 (9), sokolov2019 (8).

    Discretised exactly for a measurement that runs straight between samples: on a ramp the estimate converges to the
    slope itself.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used: this observer is model-free).
        tau: Time constant of the filter [s]. Default: Table 2.
    """

    tau: Positive = 0.02

    @property
    def equations(self) -> tuple[list[list[float]], list[list[float]]]:
        """A, B of z' = A z + B y1."""
        tau = self.tau
        return [[0.0, 1.0], [-1.0 / tau**2, -2.0 / tau]], [[0.0], [1.0 / tau**2]]


@dataclass(frozen=True, config=STRICT)
class LinearHighGain(_LinearFilter):
    """The linear high-gain differentiator of Vasiljevic and Khalil, reference [13] of aranovskiy2020.

    x1' = x2 + (a1/eps)(y1 - x1), x2' = (a2/eps^2)(y1 - x1): model-free.

    Its estimate of the rate is s/((eps^2/a2) s^2 + (a1 eps/a2) s + 1) y1, which with a1 = 2, a2 = 1 is (9) with
    tau = eps.
    Discretised exactly for a measurement that runs straight between samples.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used: this observer is model-free).
        epsilon: Time constant; the gains are its inverse powers [s]. Default: tuned, docs/assumptions.md.
        a1: Coefficient a1 of the polynomial s^2 + a1 s + a2. Default: sqrt(2), Butterworth poles.
        a2: Coefficient a2 of the polynomial s^2 + a1 s + a2.
    """

    epsilon: Positive = 0.0287
    a1: Positive = 1.4142135623730951
    a2: Positive = 1.0

    @property
    def equations(self) -> tuple[list[list[float]], list[list[float]]]:
        """A, B of z' = A z + B y1."""
        g1, g2 = self.a1 / self.epsilon, self.a2 / self.epsilon**2
        return [[-g1, 1.0], [-g2, 0.0]], [[g1], [g2]]


@dataclass(frozen=True, config=STRICT)
class FiniteDifference(_ModelFree):
    """The first-order difference, as used in reference [11] of aranovskiy2020 (Spong, Corke, Lozano 2001).

    x2 = (y1_k - y1_{k-1})/dt: no parameter, no model, no filter.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used: this observer is model-free).
    """

    def init(self, y: Measurement) -> Scalar:
        """Remember the measured tilt."""
        return y.y1

    def step(self, state: Scalar, y: Measurement, u: Scalar) -> tuple[Scalar, Estimate]:
        """Advance by one sample period."""
        y1, y2 = y
        return y1, Estimate(y1, (y1 - state) / self.dt, y2)


class TwistingState(NamedTuple):
    """Estimates of the tilt and its rate."""

    z0: Scalar
    z1: Scalar


@dataclass(frozen=True, config=STRICT)
class SuperTwisting(_ModelFree):
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

    L: Positive = 10.4
    l0: Positive = 1.5
    l1: Positive = 1.1

    def init(self, y: Measurement) -> TwistingState:
        """Start at rest at the measured tilt."""
        return TwistingState(y.y1, 0.0 * y.y1)

    def step(self, state: TwistingState, y: Measurement, u: Scalar) -> tuple[TwistingState, Estimate]:
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
        return TwistingState(z0, z1), Estimate(z0, z1, y2)
