"""A cheap gyro fused with the measured tilt: a Kalman filter of the tilt and the gyro's bias."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.inputs.types import STRICT, Positive

RATE_START = 0.02
"""Standard deviation of the rate at the start, about zero: that of `gyro_free` [rad/s]."""
MIN_TILT_SIGMA = 1e-6
"""A y1 without any noise counts with this one, as for the law `lqg` [rad]."""

Covariance = Sequence[Scalar]
"""Covariance of the errors of x1 and b after a sample: of x1, of both, of b."""


class State(NamedTuple):
    """Estimates of tilt and bias, the gyro's reading, and the covariance of both estimates' errors."""

    x1: Scalar
    b: Scalar
    reading: Scalar
    xx: Scalar
    xb: Scalar
    bb: Scalar


@dataclass(frozen=True, config=STRICT)
class MemsFused:
    """A cheap gyro fused with the measured tilt: a Kalman filter of the tilt and the gyro's bias.

    x1' = g - b - n, b' = w, y1 = x1 + v at the samples, where g is the gyro's reading.

    Between samples the rate runs straight. n is the gyro's white noise, v that of y1. The bias walks by w, whose Allan
    deviation meets the gyro's bias instability at 3 s, where IEEE Std 952 reads the walk's coefficient: so b is off by
    the bias instability after a second. The estimate of the rate is g - b.

    The filter starts at rest at the measured tilt: the first reading is taken for the bias, so that no offset matters.
    y1 tells how far that reading is off.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used).
        noise: Noise of the tilt and of the gyro, by the sensors' datasheet.
        rate_start: Standard deviation of the rate at the start, about zero [rad/s].
        walk_factor: Factor on the walk of the bias; 1 is the datasheet's.
    """

    needs: ClassVar[tuple[str, ...]] = ("gyro",)

    dt: Positive
    model: ReducedModel
    noise: MeasurementNoise
    rate_start: Positive = RATE_START
    walk_factor: Positive = 1.0

    def init(self, y: Measurement) -> Any:
        """Start at rest at the measured tilt: what the gyro shows is its bias."""
        R = self._tilt_variance + 0.0 * y.y1
        return State(y.y1, y.gyro, y.gyro, *first_covariance(R, self._white, self.rate_start))

    def step(self, state: Any, y: Measurement, u: Scalar) -> tuple[Any, Estimate]:
        """Advance by one sample period."""
        x1, b, before, *known = state
        walk = self.walk_factor * self.noise.gyro_walk
        k1, k2, known = next_gains(known, self._tilt_variance, self.dt, self._white, walk)
        x1 = x1 + self.dt * (0.5 * (before + y.gyro) - b)
        e = y.y1 - x1
        x1, b = x1 + k1 * e, b + k2 * e
        return State(x1, b, y.gyro, *known), Estimate(x1, y.gyro - b, y.y2)

    @property
    def _white(self) -> float:
        """Standard deviation of a sample's white noise [rad/s]."""
        return self.noise.gyro * math.sqrt(0.5 / self.dt)

    @property
    def _tilt_variance(self) -> float:
        """Variance of y1 at a tick: a sample that counts n times has sqrt(n) times the noise each time [rad^2]."""
        return max(self.noise.tilt * math.sqrt(self.noise.repeats), MIN_TILT_SIGMA) ** 2


def first_covariance(R: Scalar, white: float, rate_start: float) -> Covariance:
    """Return the covariance after the first sample: x1 is what is measured, and the rate is about zero.

    Args:
        R: Variance of a sample of y1 [rad^2].
        white: Standard deviation of a sample of the gyro [rad/s].
        rate_start: Standard deviation of the rate [rad/s].
    """
    return R, 0.0 * R, rate_start**2 + white**2 + 0.0 * R


def next_gains(
    covariance: Covariance, R: Scalar, dt: float, white: float, walk: float
) -> tuple[Scalar, Scalar, Covariance]:
    """Advance the covariance by a sample.

    Args:
        covariance: The covariance after the sample before.
        R: Variance of a sample of y1 [rad^2].
        dt: Sample period [s].
        white: Standard deviation of a sample of the gyro [rad/s].
        walk: Standard deviation of the bias' walk after a second [rad/s].

    Returns:
        The gains on x1 [1] and on the bias [1/s], and the covariance after the sample.
    """
    xx, xb, bb = covariance
    xx = xx + dt * (dt * bb - 2.0 * xb) + (white * dt) ** 2
    xb = xb - dt * bb
    bb = bb + walk**2 * dt
    k1, k2 = xx / (xx + R), xb / (xx + R)
    return k1, k2, (R * k1, R * k2, bb - k2 * xb)
