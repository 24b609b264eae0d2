"""The tilt rate from tilt and angular acceleration alone, as in a gyro-free inertial measurement unit.

A Kalman filter that the measured angular acceleration drives; no model of what moves the body. The idea is that of
E. Edwan, S. Knedlik, O. Loffeld, "Angular motion estimation using dynamic models in a gyro-free inertial measurement
unit", Sensors 12(5), 2012, doi:10.3390/s120505310, for one axis and two accelerometers.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.reduced_model import NO_MODEL, ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.inputs.types import STRICT, NonNegative, Positive


class State(NamedTuple):
    """Prediction of sample k, p, z, b, and its covariance."""

    p: Scalar
    z: Scalar
    b: Scalar
    pp: Scalar
    pz: Scalar
    pb: Scalar
    zz: Scalar
    zb: Scalar
    bb: Scalar


@dataclass(frozen=True, config=STRICT)
class GyroFree:
    """The tilt rate from tilt and angular acceleration alone, as in a gyro-free inertial measurement unit.

    x1' = x2, x2' = alpha, and the sensors show y1 = x1 + v and a = alpha + b + n, at the samples.

    v and n are the noise of the same two accelerometers, so they are correlated; b is what is wrong with a for good:
    the offset between the accelerometers, or gravity seen by a misaligned one. Between samples alpha is taken to run
    straight. With h = dt, p = x1 - h^2/6 alpha and z = x2 - h/2 alpha that is, exactly,

        p+ = p + h z + h^2 alpha,  z+ = z + h alpha,  y1 = p + h^2/6 alpha + v,  alpha = a - b - n,

    a linear system which each sample's n enters once: a Kalman filter whose process and measurement noise are
    correlated. Its gains vary with time, from the uncertainty of b at the start, which a steady gain would
    take seconds to get over, to next to nothing.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used).
        noise: Of tilt and angular acceleration, by the sensors' datasheet.
        rate_start: Standard deviation of the rate at the start, about zero [rad/s].
        bias_start: Standard deviation of the acceleration's offset b at the start [rad/s^2]. On the bundled rig the
            default stands for 5 mg between the accelerometers, or a misalignment of 0.3 degrees. Worse mounted sensors
            need more.
        bias_walk: Random walk of the offset b: its standard deviation after a second [rad/s^2].
        jerk: Standard deviation of the mean acceleration between two samples from that of a straight line [rad/s^2].
    """

    needs: ClassVar[tuple[str, ...]] = ("acceleration",)

    dt: Positive
    model: ReducedModel
    noise: MeasurementNoise
    rate_start: Positive = 0.02
    bias_start: Positive = 0.35
    bias_walk: NonNegative = 0.01
    jerk: NonNegative = 0.1

    def __post_init__(self) -> None:
        if not (self.noise.tilt or self.noise.acceleration or self.bias_walk or self.jerk):
            raise ValueError("bias_walk = 0 and jerk = 0: with sensors without noise one of them must be positive")

    def init(self, y: Measurement) -> Any:
        """Start at rest at the measured tilt, with no bias; of the tilt nothing else is known."""
        zero = 0.0 * y.y1
        p = y.y1 - self.dt * self.dt / 6.0 * y.acceleration  # so that the first sample shows what is expected
        known = (1.0 + zero, zero, zero, self.rate_start**2 + zero, zero, self.bias_start**2 + zero)
        return self._sample(State(p, zero, zero, *known), y)[0]

    def step(self, state: Any, y: Measurement, u: Scalar) -> tuple[Any, Estimate]:
        """Advance by one sample period."""
        state, x1, x2 = self._sample(state, y)
        return state, Estimate(x1, x2, y.y2)

    def _sample(self, state: Any, y: Measurement) -> tuple[Any, Scalar, Scalar]:
        """Correct what was expected of a sample by what it shows, and advance to the next; x1 and x2 between both."""
        h, d = self.dt, self.dt * self.dt / 6.0
        p, z, b, pp, pz, pb, zz, zb, bb = state

        # Correct p, z, b, n by e = y1 - p - d alpha, in which are the errors of p and -d b, (c - d) n and v'.
        c, nn, rest = self._noise
        e = y.y1 - p - d * (y.acceleration - b)
        ep, ez, eb, en = pp - d * pb, pz - d * zb, pb - d * bb, (c - d) * nn
        ee = ep - d * eb + (c - d) * en + rest
        kp, kz, kb, kn = ep / ee, ez / ee, eb / ee, en / ee
        p, z, b, n = p + kp * e, z + kz * e, b + kb * e, kn * e
        alpha = y.acceleration - b - n
        x1, x2 = p + d * alpha, z + 0.5 * h * alpha

        # What remains uncertain: of p, z, b, and of m = b + n, which is alpha's error.
        pp, pz, zz = pp - kp * ep, pz - kp * ez, zz - kz * ez
        pb, zb, bb = pb - kp * eb, zb - kz * eb, bb - kb * eb
        pm, zm, bm = pb - kp * en, zb - kz * en, bb - kb * en
        mm = bm - kn * eb + nn - kn * en + self.jerk**2

        # Advance: p+ = r + h^2 alpha with r = p + h z, z+ = z + h alpha.
        r, rr, rz, rb, rm = p + h * z, pp + h * (2.0 * pz + h * zz), pz + h * zz, pb + h * zb, pm + h * zm
        ahead = State(
            p=r + h * h * alpha,
            z=z + h * alpha,
            b=b,
            pp=rr + h * h * (h * h * mm - 2.0 * rm),
            pz=rz + h * (h * (h * mm - zm) - rm),
            pb=rb - h * h * bm,
            zz=zz + h * (h * mm - 2.0 * zm),
            zb=zb - h * bm,
            bb=bb + h * self.bias_walk**2,
        )
        return ahead, x1, x2

    @cached_property
    def _noise(self) -> tuple[float, float, float]:
        """See `decorrelated`."""
        return decorrelated(self.noise, self.noise.acceleration)


def decorrelated(noise: MeasurementNoise, n: float) -> tuple[float, float, float]:
    """Return c and the variance of n and of v', where v = c n + v' and v' is independent of n.

    Args:
        noise: Of tilt and angular acceleration.
        n: Standard deviation of the acceleration, in the observer's unit.
    """
    c = noise.correlation * noise.tilt / n if n else 0.0
    return c, n**2, noise.tilt**2 * (1.0 - noise.correlation**2)


def steady_error(noise: MeasurementNoise, dt: float) -> float:
    """Return the standard deviation of x2 by the sensors' white noise, once the filter with its defaults has settled.

    The stationary covariance of the filter's own equations: those of p, z, b above, driven by n and the jerk.

    Args:
        noise: Of tilt and angular acceleration.
        dt: Sample period [s].

    Returns:
        The error [rad/s].
    """
    from scipy.linalg import block_diag, solve_discrete_are

    own = GyroFree(dt, NO_MODEL, noise)
    (c, nn, rest), h, d = own._noise, dt, dt * dt / 6.0
    F = np.array([[1.0, h, -h * h], [0.0, 1.0, -h], [0.0, 0.0, 1.0]])
    into, shows = np.array([[-h * h], [-h], [0.0]]), np.array([[1.0, 0.0, -d]])
    Q = (nn + own.jerk**2) * into @ into.T + np.diag([0.0, 0.0, h * own.bias_walk**2])
    R = np.array([[(c - d) ** 2 * nn + rest]])
    P = block_diag(solve_discrete_are(F.T, shows.T, Q, R, s=(c - d) * nn * into), nn)  # of p, z, b, n before a sample
    e = np.append(shows, c - d)
    after = P - np.outer(P @ e, P @ e) / (e @ P @ e + rest)
    x2 = np.array([0.0, 1.0, -h / 2.0, -h / 2.0])
    return math.sqrt(x2 @ after @ x2)
