"""The fibre-optic gyro on the frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated

from pydantic.dataclasses import dataclass

from cmg_mj.core.types import IdealReading
from cmg_mj.elementwise import Scalar, clip, radians
from cmg_mj.inputs.field_types import STRICT, Batched, Instant, NonNegative, Positive, Rate


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

    channels = 1

    @property
    def white_noise_sigma(self) -> float:
        """Standard deviation of one sample [rad/s]."""
        return radians(self.angle_random_walk_deg_rth) / 60.0 * math.sqrt(self.rate_hz)

    def make_reading_function(self) -> Callable[[IdealReading, Sequence[Scalar]], Scalar]:
        """Return a function (ideal reading, standard normals) -> tilt rate [rad/s]. It remembers its low-pass."""
        sigma = self.white_noise_sigma
        bias = math.radians(self.bias_deg_h) / 3600.0
        limit = math.radians(self.range_deg_s)
        # The share of a step that a first-order low-pass has taken after one sample period.
        share = 1.0 - math.exp(-2.0 * math.pi * self.bandwidth_hz / self.rate_hz) if self.bandwidth_hz else 1.0
        passed: Scalar = None

        def measure(ideal: IdealReading, normal: Sequence[Scalar]) -> Scalar:
            nonlocal passed
            passed = ideal.gyro if passed is None else passed + share * (ideal.gyro - passed)
            return clip(passed + bias + sigma * normal[0], -limit, limit)

        return measure
