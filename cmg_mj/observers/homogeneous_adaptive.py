"""The homogeneous differentiator, which takes the equilibrium bias from the adaptive observer."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.types import BIAS, Measurement
from cmg_mj.inputs.types import STRICT, Positive
from cmg_mj.observers.adaptive import Adaptive
from cmg_mj.observers.adaptive import State as AdaptiveState
from cmg_mj.observers.homogeneous import Homogeneous
from cmg_mj.observers.model_copy import CopyState


class State(NamedTuple):
    """The states of both."""

    adaptive: AdaptiveState
    homogeneous: CopyState


class BiasedEstimate(NamedTuple):
    """The estimate and the bias it was made with."""

    x1: Scalar
    x2: Scalar
    x3: Scalar
    bias_rad: Scalar


@dataclass(frozen=True, config=STRICT)
class HomogeneousAdaptive:
    """The homogeneous differentiator, which takes the equilibrium bias from the adaptive observer.

    aranovskiy2020 (11) with sin(y1 + e), e estimated by dao2023's observer beside it.

    In (11) gravity is taken at y1, where it pulls at y1 + e: that error k1 (M e/J1/k2)^(alpha/(2 alpha - 1)) of the
    rate is what the estimate of e removes. Nothing flows back: the adaptive observer does not see (11).

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        k1: Gain of the tilt's correction in (11).
        k2: Gain of the rate's correction in (11).
        alpha: Exponent of the corrections in (11); 1 makes them linear.
        L: Gains of the adaptive observer on x1 and x2.
        Gamma: Learning weight of the bias in the adaptive observer [rad^2].
        Sigma: Learning weight of the measured tilt in the adaptive observer [1/(rad^2 s)].
    """

    dt: Positive
    model: ReducedModel
    k1: Positive = 20.0
    k2: Positive = 150.0
    alpha: Annotated[float, Field(gt=0.5, le=1.0)] = 0.85
    L: tuple[float, float] = Adaptive.L
    Gamma: Positive = Adaptive.Gamma[0]
    Sigma: Positive = Adaptive.Sigma

    extra_signals = (BIAS,)

    def __post_init__(self) -> None:
        _ = self._adaptive  # made now, so that what it refuses is refused at construction

    @cached_property
    def _homogeneous(self) -> Homogeneous:
        return Homogeneous(self.dt, self.model, k1=self.k1, k2=self.k2, alpha=self.alpha)

    @cached_property
    def _adaptive(self) -> Adaptive:
        weights = (self.Gamma, *Adaptive.Gamma[1:])
        return Adaptive(self.dt, self.model, L=self.L, Gamma=weights, Sigma=self.Sigma)

    def init(self, y: Measurement) -> State:
        """Start both at rest at the measured tilt, the bias unknown."""
        return State(self._adaptive.init(y), self._homogeneous.init(y))

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, BiasedEstimate]:
        """Advance by one sample period: first the bias, then (11) with it."""
        adaptive, adaptive_estimate = self._adaptive.step(state.adaptive, y, u)
        bias = adaptive_estimate[3]
        homogeneous, estimate = self._homogeneous.step(state.homogeneous, y, u, bias)
        return State(adaptive, homogeneous), BiasedEstimate(*estimate, bias)
