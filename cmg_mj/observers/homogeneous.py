"""The homogeneous finite-time differentiator, aranovskiy2020 (11), alone and with an estimated equilibrium bias."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, signed_powers, sqrt
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.types import BIAS, STATE_NAMES, Estimate, Measurement
from cmg_mj.inputs.types import STRICT, NonNegative, Positive
from cmg_mj.observers.adaptive import Adaptive
from cmg_mj.observers.adaptive import State as AdaptiveState
from cmg_mj.observers.model_copy import MAX_RATE, CopyState, follow, stages

Exponent = Annotated[float, Field(gt=0.5, le=1.0)]


@dataclass(frozen=True, config=STRICT)
class Homogeneous:
    """The homogeneous finite-time differentiator, aranovskiy2020 (11).

    x1' = x2 - k1 [e]^alpha, x2' = f2(y, x2, u) - k2 [e]^(2 alpha - 1), e = x1 - y1, [e]^a = |e|^a sign e.

    One step of `model_copy.follow` a sample. The right-hand side is steep at e = 0 only below 1e-9 rad, far under any
    sensor's noise, so nothing chatters.

    The papers name a friction model as future work. Here it is, switched off by default: the tilt axis resists with the
    torque friction x2/sqrt(x2^2 + width^2) + damping x2, dry friction with its sign made smooth. It enters f2 as
    -c(x2) x2/D, c at the last estimate: at 200 Hz the rate changes little in a sample.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        k1: Gain of the tilt's correction. Default: Table 2.
        k2: Gain of the rate's correction. Default: Table 2. All positive gains k1, k2 are stable.
        alpha: Exponent of the corrections; 1 makes the observer linear. Default: Table 2.
        friction_n_m: Dry friction torque of the tilt axis, of the whole rig [N m].
        damping_n_m_s: Viscous friction of the tilt axis, of the whole rig [N m s].
        friction_width_rad_s: Rate at which dry friction reaches 0.7 of its torque; take about the error of the
            estimate [rad/s].
    """

    dt: Positive
    model: ReducedModel
    k1: Positive = 20.0
    k2: Positive = 150.0
    alpha: Exponent = 0.85
    friction_n_m: NonNegative = 0.0
    damping_n_m_s: NonNegative = 0.0
    friction_width_rad_s: Positive = 0.05

    def __post_init__(self) -> None:
        resistance = self.friction(0.0, 0.0)
        if resistance * self.dt > MAX_RATE:
            raise ValueError(
                f"friction_n_m, damping_n_m_s: too much for the sample period: friction_n_m/friction_width_rad_s + "
                f"damping_n_m_s must be below {MAX_RATE / self.dt / resistance:.3g} times its value"
            )

    @cached_property
    def _resists(self) -> bool:
        return bool(self.friction_n_m or self.damping_n_m_s)

    def correction(self, e: Scalar, _: None) -> tuple[Scalar, Scalar]:
        """k1 [e]^alpha, k2 [e]^(2 alpha - 1)."""
        a, b = signed_powers(e, self.alpha)
        return self.k1 * a, self.k2 * b

    def friction(self, x2: Scalar, x3: Scalar) -> Scalar:
        """Return the part of f2 that friction takes, divided by x2 [1/s]."""
        width = self.friction_width_rad_s
        torque = self.friction_n_m / sqrt(x2 * x2 + width * width) + self.damping_n_m_s
        return torque / (self.model.gimbals * self.model.inertia(x3))

    def init(self, y: Measurement) -> CopyState:
        """Start at rest at the measured tilt."""
        return CopyState(y.y1, 0.0 * y.y1, y, self.model.terms(*y))

    def step(self, state: CopyState, y: Measurement, u: Scalar, bias: Scalar = 0.0) -> tuple[CopyState, Estimate]:
        """Advance by one sample period.

        Args:
            state: The state at sample k-1.
            y: The measurement at sample k.
            u: The gimbal rate held since [rad/s].
            bias: The equilibrium bias e at sample k, as far as it is known: gravity pulls at y1 + e [rad].

        Returns:
            The state and the estimate at sample k.
        """
        x1, x2, before, terms = state
        resisting = self.friction(x2, before[1]) if self._resists else 0.0
        begin, middle, end, terms = stages(self.model, before, terms, y, u, bias, resisting)
        x1, x2 = follow(self.correction, x1, x2, self.dt, begin, middle, end)
        return CopyState(x1, x2, y, terms), Estimate(x1, x2, y[1])


class BothStates(NamedTuple):
    """The states of both."""

    adaptive: AdaptiveState
    homogeneous: CopyState


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
    k1: Positive = Homogeneous.k1
    k2: Positive = Homogeneous.k2
    alpha: Exponent = Homogeneous.alpha
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

    def init(self, y: Measurement) -> BothStates:
        """Start both at rest at the measured tilt, the bias unknown."""
        return BothStates(self._adaptive.init(y), self._homogeneous.init(y))

    def step(self, state: BothStates, y: Measurement, u: Scalar) -> tuple[BothStates, Any]:
        """Advance by one sample period: first the bias, then (11) with it."""
        adaptive, biased = self._adaptive.step(state.adaptive, y, u)
        bias = biased[len(STATE_NAMES)]
        homogeneous, estimate = self._homogeneous.step(state.homogeneous, y, u, bias)
        return BothStates(adaptive, homogeneous), (*estimate, bias)
