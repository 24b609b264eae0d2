"""The fibre-optic gyro on the frame."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip, radians
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.sensor import SampledSensor, Site
from cmg_mj.core.types import IdealReading
from cmg_mj.inputs.types import STRICT, Batched, Instant, NonNegative, Positive, Rate


@dataclass(frozen=True, config=STRICT)
class Fog:
    """A fibre-optic gyro on the frame, along the tilt axis: the reference for estimates on a real rig.

    Its class is that of KVH's DSP-1750 (angle random walk 0.013 deg/rt(h), range 490 deg/s, bandwidth 440 Hz), with
    a margin on the noise.

    Attributes:
        rate_hz: Sampling rate of the gyro.
        angle_random_walk_deg_rth: Angle random walk N, made by white noise; one sample's sigma is N * sqrt(rate).
        bias_deg_h: Constant offset of the rate [deg/h].
        bandwidth_hz: Bandwidth of the gyro's first-order low-pass; 0 for no low-pass.
        range_deg_s: Largest rate that a reading shows [deg/s].
        latency_s: Delay from the sampling of a reading to its use by the controller [s].
    """

    rate_hz: Rate = 200.0
    angle_random_walk_deg_rth: Annotated[NonNegative, Batched()] = 0.02
    bias_deg_h: float = 0.0
    bandwidth_hz: NonNegative = 440.0
    range_deg_s: Positive = 490.0
    latency_s: Instant = 0.0

    @property
    def white_noise_sigma(self) -> float:
        """Standard deviation of one sample [rad/s]."""
        return radians(self.angle_random_walk_deg_rth) / 60.0 * math.sqrt(self.rate_hz)

    def at_work(self, site: Site) -> SampledSensor[Scalar]:
        """Start the gyro."""
        return SampledSensor(self.rate_hz, self.latency_s, site, lambda ideal: ideal.gyro, [_FogSignal(self, site)])


class _FogSignal:
    """The gyro's low-pass, noise, offset and range."""

    def __init__(self, part: Fog, site: Site) -> None:
        self._noise = site.noise(NoiseStream.FOG, 1)
        self._sigma = part.white_noise_sigma
        self._bias = math.radians(part.bias_deg_h) / 3600.0
        self._limit = math.radians(part.range_deg_s)
        # The share of a step that a first-order low-pass has taken after one sample period.
        self._share = 1.0 - math.exp(-2.0 * math.pi * part.bandwidth_hz / part.rate_hz) if part.bandwidth_hz else 1.0
        self._passed: Scalar = None

    def __call__(self, rate: Scalar, ideal: IdealReading) -> Scalar:
        """Read a rate [rad/s]."""
        before = self._passed
        self._passed = passed = rate if before is None else before + self._share * (rate - before)
        (normal,) = next(self._noise)
        return clip(passed + self._bias + self._sigma * normal, -self._limit, self._limit)
