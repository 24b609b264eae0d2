"""The extended Kalman filter of the reduced model with an unknown torque: an engineer's first choice."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import combinations_with_replacement
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import TORQUE, Measurement
from cmg_mj.inputs.types import STRICT, Positive

TERMS = 6
"""Number of terms of the transition's series. The rest of phi, psi and chi is below 4e-12 of each while the rig's pole
times the sample period is below 1/20. On the bundled rig that product is 0.037, and the rest is below 6e-13."""

PAIRS = tuple(combinations_with_replacement(range(4), 2))
"""Rows and columns of the stored entries of a symmetric 4x4 matrix: 11, 12, 13, 14, 22, 23, 24, 33, 34, 44."""
COLUMNS = tuple(tuple(PAIRS.index((min(i, j), max(i, j))) for j in range(4)) for i in range(4))
"""Indices in `PAIRS` of the entries of each column."""


Four = tuple[Scalar, Scalar, Scalar, Scalar]
"""x1, x2, x3, torque."""


class Covariance(NamedTuple):
    """Covariance of the error of (x1, x2, x3, torque). Only one half is stored, so that it stays symmetric."""

    p11: Scalar
    p12: Scalar
    p13: Scalar
    p14: Scalar
    p22: Scalar
    p23: Scalar
    p24: Scalar
    p33: Scalar
    p34: Scalar
    p44: Scalar


class State(NamedTuple):
    """The estimate and its covariance."""

    x1: Scalar
    x2: Scalar
    x3: Scalar
    torque: Scalar
    P: Covariance


class TorqueEstimate(NamedTuple):
    """The estimate of x, and that of the torque on the rig [N m]."""

    x1: Scalar
    x2: Scalar
    x3: Scalar
    torque_n_m: Scalar


@dataclass(frozen=True, config=STRICT)
class Kalman:
    """The extended Kalman filter of the reduced model with an unknown torque: an engineer's first choice.

    x1' = x2, x2' = f2(x, u) + (torque + white)/(n D), x3' = u + g, torque' = walk; y1 = x1 + v1, y2 = x3 + v2.

    f2 is that of (4) with D = J1 + J2 sin^2 x3, and n is the number of gimbals among which the rig is shared. The
    torque on the rig is what the model lacks: a push, friction, and the equilibrium bias e, which makes the torque
    n M cos(x1) e. Nothing in y1, y2 and u tells these apart, so the estimate is called a torque and not a bias. It is
    a random walk, with white torque beside it. The gimbals do not quite turn as commanded: the white rate g turns
    them and, through the gyroscopic torque, the rig; so the encoders also tell of that torque.

    From sample to sample u is held, and the model is linear about the estimate: with [[0, 1, 0, 0], [a, b, c, d]] the
    first two rows of its Jacobian and phi'' = a phi + b phi', phi(0) = 0, phi'(0) = 1, psi' = phi, chi' = psi, the
    transition is exactly (but for the end of a series, `TERMS`)

        [[1 + a psi, phi, c psi, d psi], [a phi, 1 + b phi + a psi, c phi, d phi], [0, 0, 1, 0], [0, 0, 0, 1]].

    The estimate takes the same linear model's step, whose error is of third order in the sample period and none on
    the linearisation (6). The process noise is exact for (6).

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        noise: Of the tilt and of the gimbal angle, by the sensors' datasheet.
        torque_walk: Random walk of the unknown torque: its standard deviation after a second [N m]. Not tuned: a
            constant e would tune it to zero.
        torque_white: White torque: standard deviation of its integral after a second [N m s]. Default: tuned with
            `cmg-mj tune observer_tuning --seed 60000`, as is gimbal_white.
        gimbal_white: White noise of the gimbals' rate: standard deviation of its integral after a second [rad].
        rate_start: Standard deviation of the rate at the start, about zero [rad/s].
        torque_start: Standard deviation of the torque at the start [N m]. On the bundled rig, 1.7 degrees of e make
            0.2 N m.
    """

    needs: ClassVar[tuple[str, ...]] = ("model", "gimbals")
    extra_signals: ClassVar[tuple[str, ...]] = (TORQUE,)

    dt: Positive
    model: ReducedModel
    noise: MeasurementNoise
    torque_walk: Positive = 0.03
    torque_white: Positive = 0.082
    gimbal_white: Positive = 0.024
    rate_start: Positive = 0.1
    torque_start: Positive = 0.2

    @cached_property
    def measurement_noise(self) -> tuple[float, float]:
        """Variances of v1 and v2 [rad^2]."""
        return self.noise.tilt**2, self.noise.gimbal**2

    @property
    def A(self) -> np.ndarray:
        """State matrix of the linearisation (6) with the torque, (4, 4)."""
        A = np.zeros((4, 4))
        A[:3, :3] = self.model.A
        A[1, 3] = 1.0 / (self.model.gimbals * self.model.J1)
        return A

    @cached_property
    def process_noise(self) -> Covariance:
        """Covariance added by a sample period, exact for the linearisation (6)."""
        from scipy.linalg import expm

        A = self.A
        per_torque = A[1, 3]
        into = np.array([[0.0, 0.0, 0.0], [0.0, per_torque, self.model.B[1, 0]], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
        into = into * [self.torque_walk, self.torque_white, self.gimbal_white]
        # Van Loan: exp [[-A, N N'], [0, A']] dt = [[., F^-1 Q], [0, F']].
        both = expm(np.block([[-A, into @ into.T], [np.zeros((4, 4)), A.T]]) * self.dt)
        Q = both[4:, 4:].T @ both[:4, 4:]
        return Covariance(*(float(0.5 * (Q[i, j] + Q[j, i])) for i, j in PAIRS))

    @cached_property
    def _powers(self) -> list[float]:
        """dt^n/n!."""
        return [self.dt**n / math.factorial(n) for n in range(TERMS + 3)]

    def init(self, y: Measurement) -> State:
        """Start at rest at the measured angles, with no torque."""
        zero = 0.0 * y.y1
        v1, v2 = self.measurement_noise
        P = (v1, 0.0, 0.0, 0.0, self.rate_start**2, 0.0, 0.0, v2, 0.0, self.torque_start**2)
        return State(y.y1, zero, y.y2, zero, Covariance(*(entry + zero for entry in P)))

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, TorqueEstimate]:
        """Advance by one sample period."""
        x, P = self._predicted(state, u, y.contact)
        v1, v2 = self.measurement_noise
        x, P = _corrected(x, P, 0, y[0], v1)
        x, P = _corrected(x, P, 2, y[1], v2)
        return State(*x, P), TorqueEstimate(*x)

    def _predicted(self, state: State, u: Scalar, contact: Scalar | None) -> tuple[Four, Covariance]:
        """Return the state and its covariance a sample period later: F P F' + Q."""
        x1, x2, x3, torque, P = state
        p11, p12, p13, p14, p22, p23, p24, p33, p34, p44 = P
        f2, a, b, c, d = self.model.slopes(x1, x2, x3, u, torque)
        f2 = f2 if contact is None else f2 + contact
        h, phi, psi, chi = self._integrals(a, b)

        jerk = a * x2 + c * u  # f2' but for b f2, which phi has
        x1, x2, x3 = x1 + h * x2 + psi * f2 + chi * jerk, x2 + phi * f2 + psi * jerk, x3 + h * u

        f11, f12, f13, f14 = 1.0 + a * psi, phi, c * psi, d * psi
        f21, f22, f23, f24 = a * phi, 1.0 + b * phi + a * psi, c * phi, d * phi
        # F P, its first two rows; the last two of F are those of the identity.
        m11 = f11 * p11 + f12 * p12 + f13 * p13 + f14 * p14
        m12 = f11 * p12 + f12 * p22 + f13 * p23 + f14 * p24
        m13 = f11 * p13 + f12 * p23 + f13 * p33 + f14 * p34
        m14 = f11 * p14 + f12 * p24 + f13 * p34 + f14 * p44
        m21 = f21 * p11 + f22 * p12 + f23 * p13 + f24 * p14
        m22 = f21 * p12 + f22 * p22 + f23 * p23 + f24 * p24
        m23 = f21 * p13 + f22 * p23 + f23 * p33 + f24 * p34
        m24 = f21 * p14 + f22 * p24 + f23 * p34 + f24 * p44
        q = self.process_noise
        ahead = Covariance(
            p11=m11 * f11 + m12 * f12 + m13 * f13 + m14 * f14 + q.p11,
            p12=m11 * f21 + m12 * f22 + m13 * f23 + m14 * f24 + q.p12,
            p13=m13 + q.p13,
            p14=m14 + q.p14,
            p22=m21 * f21 + m22 * f22 + m23 * f23 + m24 * f24 + q.p22,
            p23=m23 + q.p23,
            p24=m24 + q.p24,
            p33=p33 + q.p33,
            p34=p34 + q.p34,
            p44=p44 + q.p44,
        )
        return (x1, x2, x3, torque), ahead

    def _integrals(self, a: Scalar, b: Scalar) -> tuple[float, Scalar, Scalar, Scalar]:
        """dt, phi, psi and chi after it: phi is the sum of k_n dt^n/n! with k_(n+1) = b k_n + a k_(n-1)."""
        powers = self._powers
        before, k = 0.0, 1.0
        phi, psi, chi = powers[1], powers[2], powers[3]
        for n in range(2, TERMS + 1):
            before, k = k, b * k + a * before
            phi, psi, chi = phi + k * powers[n], psi + k * powers[n + 1], chi + k * powers[n + 2]
        return powers[1], phi, psi, chi


def _corrected(x: Four, P: Covariance, part: int, measured: Scalar, variance: float) -> tuple[Four, Covariance]:
    """Bring in one measured part of the state, whose noise has this variance."""
    column = [P[place] for place in COLUMNS[part]]
    gain = [entry / (column[part] + variance) for entry in column]
    off = measured - x[part]
    x1, x2, x3, torque = (value + k * off for value, k in zip(x, gain, strict=True))
    return (x1, x2, x3, torque), Covariance(*(p - gain[i] * column[j] for p, (i, j) in zip(P, PAIRS, strict=True)))
