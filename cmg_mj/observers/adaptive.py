"""The adaptive disturbance observer of dao2023 on the scissored pair."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, reduce
from itertools import repeat
from operator import add, mul
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, cos, dot
from cmg_mj.core.reduced_model import MARGIN, ReducedModel, is_hurwitz
from cmg_mj.core.types import BIAS, TORQUE, Measurement, as_estimate
from cmg_mj.inputs.types import STRICT, NonNegative, Positive

SINUSOID = "disturbance_n_m"

MAX_RATE = 2.0
"""Limit of the observer's rates times the sample period."""


class State(NamedTuple):
    """The estimate, that of the exosystem's state with the rows of T, and the last measurement."""

    x1: Scalar
    x2: Scalar
    xm: tuple[Scalar, ...]
    """State of the exosystem: the constant if there is one, then the two parts of the sinusoid."""
    T1: tuple[Scalar, ...]
    T2: tuple[Scalar, ...]
    y: Measurement


@dataclass(frozen=True, config=STRICT)
class Adaptive:
    """The adaptive disturbance observer of dao2023 on the scissored pair.

    dao2023 (7) to (9) for the reduced model, with what is unknown about it as r.

    The state is (x1 - e, x2), whose first entry y1 measures: as with the other observers, the estimate of x1 is one of
    y1 without its noise, not of the tilt from the true equilibrium. With D = J1 + J2 sin^2 y2,

        A = [[0, 1], [0, -u J2 sin(2 y2)/D]],  known input (u J_d w_d cos y2 + M sin y1)/D,
        B0: M cos(y1)/D for the bias e, 1/D for a torque.

    A constant torque and a bias act alike, so that only one of the two can be asked for. A sinusoidal torque has the
    exosystem [[0, -w], [w, 0]]. A step takes the implicit midpoint rule for x and T, the exosystem exactly, and the
    correction implicit in the new sample, as a Kalman filter does. It is stable for any gains, but poles beyond 2/dt
    would be followed by a factor (1 + p dt/2)/(1 - p dt/2) whose real part is negative: an error that changes its sign
    from sample to sample. Such poles are refused, and likewise a faster learning.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        bias: Estimate the equilibrium bias e.
        torque: Estimate a constant tilting torque on the whole rig instead of the bias.
        sinusoid_hz: Frequency of a sinusoidal tilting torque to estimate, such as a gait's [Hz]; 0 for none.
        known_bias_deg: Equilibrium bias e, if the observer does not estimate it [deg].
        L: Gains on x1 and x2; negative gains are stable. Default: docs/studies/tune_adaptive.py, as are Gamma and
            Sigma (poles of 25 rad/s, damping ratio 0.7, a bias learnt at 1/s).
        Gamma: Learning weights of the bias [rad^2], of a constant torque and of the two parts of a sinusoid [(N m)^2].
        Sigma: Learning weight of the measured tilt [1/(rad^2 s)].
    """

    dt: Positive
    model: ReducedModel
    bias: bool = True
    torque: bool = False
    sinusoid_hz: NonNegative = 0.0
    known_bias_deg: Annotated[float, Field(gt=-90.0, lt=90.0)] = 0.0
    L: tuple[float, float] = (-35.0, -625.0)
    Gamma: tuple[Positive, Positive, Positive] = (1.0, 48.0, 48.0)
    Sigma: Positive = 125.0

    def __post_init__(self) -> None:
        if self.bias and self.torque:
            raise ValueError(
                "bias, torque: both are true, but a constant torque and an equilibrium bias act alike; "
                "one of them must be false"
            )
        if not (self.bias or self.torque or self.sinusoid_hz):
            raise ValueError("bias, torque, sinusoid_hz: nothing to estimate; make one of them true or greater than 0")
        if self.bias and self.known_bias_deg:
            raise ValueError("known_bias_deg: the bias cannot be known and estimated; set bias to false")
        if 2.0 * self.sinusoid_hz * self.dt >= 1.0:
            raise ValueError(
                f"sinusoid_hz = {self.sinusoid_hz:g}: must be below half the sample rate, {0.5 / self.dt:g} Hz"
            )
        poles = np.linalg.eigvals([[self.L[0], 1.0], [self.L[1], 0.0]])  # of A + L C at rest
        if not is_hurwitz(poles):
            listed = ", ".join(f"{p:.3g}" for p in poles)
            raise ValueError(
                f"L: A + L C must be Hurwitz (both negative, left of -{MARGIN:g} 1/s), its eigenvalues are {listed}"
            )
        fastest, limit = float(np.abs(poles).max()), MAX_RATE / self.dt
        if fastest >= limit:
            raise ValueError(
                f"L: too fast for the sample period: an eigenvalue of A + L C has the size {fastest:.3g} 1/s, "
                f"which must be below {MAX_RATE:g}/dt = {limit:g} 1/s"
            )
        if self.learning_rate >= limit:
            raise ValueError(
                f"Sigma, Gamma: too large for the sample period: the unknown would be learnt at "
                f"{self.learning_rate:.3g} 1/s, which must be below {MAX_RATE:g}/dt = {limit:g} 1/s"
            )

    @property
    def learning_rate(self) -> float:
        """Sigma times the sum of Gamma_i |T1_i|^2 over the columns, for T at rest at y1 = 0 and y2 = 0 [1/s].

        T1 is what the tilt's error makes of an unknown: its share of the acceleration through s^2 - l1 s - l2, at s = 0
        for a constant and at s = j w for a sinusoid, whose two columns are a quarter period apart.
        """
        (l1, l2), w = self.L, 2.0 * math.pi * self.sinusoid_hz
        per_torque = 1.0 / (self.model.gimbals * self.model.J1)
        bias, torque, sinusoid = self.Gamma
        constant = bias * (self.model.gravity_torque / self.model.J1) ** 2 if self.bias else 0.0
        constant += torque * per_torque**2 if self.torque else 0.0
        swinging = sinusoid * per_torque**2 / ((w * w + l2) ** 2 + (l1 * w) ** 2) if w else 0.0
        return self.Sigma * (constant / l2**2 + swinging)

    @cached_property
    def _unknowns(self) -> dict[str, list[float]]:
        """Name of each unknown, and its weights in Gamma: one for a constant, two for a sinusoid."""
        bias, torque, sinusoid = self.Gamma
        return {
            **({BIAS: [bias]} if self.bias else {}),
            **({TORQUE: [torque]} if self.torque else {}),
            **({SINUSOID: [sinusoid, sinusoid]} if self.sinusoid_hz else {}),
        }

    @property
    def extra_signals(self) -> tuple[str, ...]:
        """Names of what is estimated beyond x."""
        return tuple(self._unknowns)

    @cached_property
    def _minus_Sigma_Gamma(self) -> list[float]:
        """-Sigma Gamma, its diagonal, an entry a state of the exosystem."""
        return [-self.Sigma * weight for weights in self._unknowns.values() for weight in weights]

    @cached_property
    def _angle(self) -> tuple[float, float]:
        """Cosine and sine of the angle by which the exosystem turns in a sample."""
        angle = 2.0 * math.pi * self.sinusoid_hz * self.dt
        return math.cos(angle), math.sin(angle)

    def init(self, y: Measurement) -> State:
        """Start at rest at the measured tilt, with nothing known and T = 0."""
        zero = 0.0 * y.y1
        none = (zero,) * len(self._minus_Sigma_Gamma)
        return State(y.y1, zero, none, none, none, y)

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Any]:
        """Advance by one sample period."""
        h, (l1, l2), model = self.dt, self.L, self.model
        x1, x2, xm, T1, T2, before = state
        y1, y2 = y
        tilt, gimbal = 0.5 * (before[0] + y1), 0.5 * (before[1] + y2)
        drift, gain, damping = model.terms(tilt + math.radians(self.known_bias_deg), gimbal)
        a = -u * damping
        if y.contact is not None:
            drift = drift + y.contact
        B0 = self._acting(tilt, model.inertia(gimbal))
        forward = _midpoint_rule(h, l1, l2, a)  # of v' = (A + L C) v + (w1, w2), A + L C = [[l1, 1], [l2, a]]

        # (7) without its correction: x' = A x + B0 r + known input + L (C x - y), and xm' = Am xm.
        r = dot(B0, xm)
        x1, x2 = forward(x1, x2, -l1 * tilt, r + drift + u * gain - l2 * tilt)
        xm = self._turned(xm)
        # (8): T' = (A + L C) T - T Am + B0 Cm
        T1, T2 = map(self._turned, zip(*map(forward, T1, T2, repeat(0.0), B0), strict=True))
        # (9): Lm = -Gamma (C T)^T Sigma, C T the first row of T
        Lm = list(map(mul, self._minus_Sigma_Gamma, T1))
        # The correction of (7), x' += T Lm nu, xm' += Lm nu, with nu = C x - y after it.
        nu = (x1 - y1) / (1.0 - h * dot(Lm, T1))
        change = [h * lm * nu for lm in Lm]
        x1, x2 = reduce(add, map(mul, T1, change), x1), reduce(add, map(mul, T2, change), x2)
        xm = tuple(map(add, xm, change))
        # A constant, and the second part of a sinusoid.
        signals = [xm[-1 if name == SINUSOID else 0] for name in self._unknowns]
        return State(x1, x2, xm, T1, T2, y), as_estimate((x1, x2, y2, *signals))

    def _acting(self, tilt: Scalar, inertia: Scalar) -> list[Scalar]:
        """Second row of B0 Cm, an entry a state of the exosystem; of a sinusoid its mean over the sample."""
        per_torque = 1.0 / (self.model.gimbals * inertia)  # of a torque on the whole rig, which the gimbals share
        acting = []
        if self.bias:
            acting.append(self.model.gravity_torque * cos(tilt) / inertia)
        elif self.torque:
            acting.append(per_torque)
        if self.sinusoid_hz:
            c, s = self._angle
            acting += [per_torque * 0.5 * s, per_torque * 0.5 * (1.0 + c)]
        return acting

    def _turned(self, row: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """exp(Am h) applied to the exosystem's state, or exp(-Am h) from the right to a row of T: a constant stays."""
        if not self.sinusoid_hz:
            return row
        c, s = self._angle
        *constant, p, q = row
        return (*constant, c * p - s * q, s * p + c * q)


def _midpoint_rule(h: float, l1: float, l2: float, a: Scalar) -> Callable:
    """Return the step (1 - h/2 M) v+ = (1 + h/2 M) v + h w with M = [[l1, 1], [l2, a]], of (v1, v2, w1, w2)."""
    k = 0.5 * h
    scale = 1.0 / ((1.0 - k * l1) * (1.0 - k * a) - k * k * l2)

    def forward(v1: Scalar, v2: Scalar, w1: Scalar, w2: Scalar) -> tuple[Scalar, Scalar]:
        r1 = v1 + k * (l1 * v1 + v2) + h * w1
        r2 = v2 + k * (l2 * v1 + a * v2) + h * w2
        return scale * ((1.0 - k * a) * r1 + k * r2), scale * (k * l2 * r1 + (1.0 - k * l1) * r2)

    return forward
