"""The homogeneous finite-time differentiator, aranovskiy2020 (11)."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.elementwise import Scalar, signed_powers, sqrt
from cmg_mj.fields import STRICT, NonNegative, Positive
from cmg_mj.observers.protocol import Estimate, Measurement
from cmg_mj.reduced import ReducedModel

LARGEST_RESISTANCE = 2.5  # of a step; the classical Runge-Kutta step is stable up to 2.78


class State(NamedTuple):
    """The estimate, the last measurement, and the model's terms there."""

    x1: Scalar
    x2: Scalar
    y: Measurement
    terms: tuple[Scalar, Scalar, Scalar]


@dataclass(frozen=True, config=STRICT)
class Homogeneous:
    """x1' = x2 - k1 [e]^alpha, x2' = f2(y, x2, u) - k2 [e]^(2 alpha - 1), e = x1 - y1, [e]^a = |e|^a sign e.

    One classical Runge-Kutta step a sample, the measurement running straight between samples and the input held.
    The right-hand side is steep at e = 0 only below 1e-9 rad, far under any sensor's noise, so nothing chatters.

    The papers name a friction model as future work. Here it is, switched off by default: the tilt axis resists with the
    torque friction x2/sqrt(x2^2 + width^2) + damping x2, dry friction with its sign made smooth. It enters f2 as
    -c(x2) x2/D, c at the last estimate: at 200 Hz the rate changes little in a sample.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        k1: First gain. Default: Table 2.
        k2: Second gain. Default: Table 2. (s^2 + k1 s + k2 is Hurwitz for all positive gains.)
        alpha: Exponent in (1/2, 1]. Default: Table 2.
        friction_n_m: Dry friction torque of the tilt axis, of the whole rig [N m].
        damping_n_m_s: Viscous friction of the tilt axis, of the whole rig [N m s].
        friction_width_rad_s: The rate at which the dry friction has reached 0.7 of its torque [rad/s]; about the
            error of the estimate, below which its sign is unknown.
    """

    dt: Positive
    model: ReducedModel
    k1: Positive = 20.0
    k2: Positive = 150.0
    alpha: Annotated[float, Field(gt=0.5, le=1.0)] = 0.85
    friction_n_m: NonNegative = 0.0
    damping_n_m_s: NonNegative = 0.0
    friction_width_rad_s: Positive = 0.05

    def __post_init__(self) -> None:
        resistance = self._resistance(0.0, 0.0)
        if resistance * self.dt > LARGEST_RESISTANCE:
            raise ValueError(
                f"friction_n_m, damping_n_m_s: too much for the sample period: friction_n_m/friction_width_rad_s + "
                f"damping_n_m_s must be below {LARGEST_RESISTANCE / self.dt / resistance:.3g} times what it is"
            )

    @cached_property
    def _resists(self) -> bool:
        return bool(self.friction_n_m or self.damping_n_m_s)

    def init(self, y: Measurement) -> State:
        """Start at rest at the measured tilt."""
        return State(y.y1, 0.0 * y.y1, y, self.model.terms(*y))

    def _resistance(self, x2: Scalar, x3: Scalar) -> Scalar:
        """What friction takes from f2, divided by x2 [1/s]."""
        width = self.friction_width_rad_s
        torque = self.friction_n_m / sqrt(x2 * x2 + width * width) + self.damping_n_m_s
        return torque / (self.model.gimbals * self.model.inertia(x3))

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period."""
        return self.step_with_bias(state, y, u, 0.0)

    def step_with_bias(self, state: State, y: Measurement, u: Scalar, bias: Scalar) -> tuple[State, Estimate]:
        """The same with gravity pulling at y1 + bias: what (11) would be if e were known.

        Args:
            state: The state at sample k-1.
            y: The measurement at sample k.
            u: The gimbal rate held since [rad/s].
            bias: The equilibrium bias e at sample k, as far as it is known [rad].

        Returns:
            The state and the estimate at sample k.
        """
        h, k1, k2, alpha = self.dt, self.k1, self.k2, self.alpha
        x1, x2, (y1_before, y2_before), (drift, gain, damping) = state
        y1, y2 = y
        y1_middle = 0.5 * (y1_before + y1)
        middle = self.model.terms(y1_middle + bias, 0.5 * (y2_before + y2))
        end = self.model.terms(y1 + bias, y2)
        c = self._resistance(x2, y2_before) if self._resists else 0.0

        known, loss = drift + u * gain, u * damping + c
        e_alpha, e_beta = signed_powers(x1 - y1_before, alpha)
        p1 = x2 - k1 * e_alpha
        p2 = known - loss * x2 - k2 * e_beta

        drift, gain, damping = middle
        known, loss = drift + u * gain, u * damping + c
        w = x2 + 0.5 * h * p2
        e_alpha, e_beta = signed_powers(x1 + 0.5 * h * p1 - y1_middle, alpha)
        q1 = w - k1 * e_alpha
        q2 = known - loss * w - k2 * e_beta

        w = x2 + 0.5 * h * q2
        e_alpha, e_beta = signed_powers(x1 + 0.5 * h * q1 - y1_middle, alpha)
        r1 = w - k1 * e_alpha
        r2 = known - loss * w - k2 * e_beta

        drift, gain, damping = end
        known, loss = drift + u * gain, u * damping + c
        w = x2 + h * r2
        e_alpha, e_beta = signed_powers(x1 + h * r1 - y1, alpha)
        s1 = w - k1 * e_alpha
        s2 = known - loss * w - k2 * e_beta

        x1 = x1 + h / 6.0 * (p1 + 2.0 * (q1 + r1) + s1)
        x2 = x2 + h / 6.0 * (p2 + 2.0 * (q2 + r2) + s2)
        return State(x1, x2, y, end), Estimate(x1, x2, y2)
