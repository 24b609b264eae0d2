"""The gimbals' absolute encoders."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.sensor import SampledSensor, Shown, Site
from cmg_mj.inputs.types import STRICT, Instant, NonNegative, Rate


@dataclass(frozen=True, config=STRICT)
class Encoder:
    """The gimbals' absolute encoders (AS5045 in the Dynamixel MX-106: 12 bit).

    Attributes:
        rate_hz: Sampling rate of the encoders; the papers' servos are polled once a control period.
        counts_per_revolution: Resolution; 0 for readings that are not rounded.
        latency_s: Delay from the sampling of a reading to its use by the controller [s].
    """

    rate_hz: Rate = 200.0
    counts_per_revolution: NonNegative = 4096.0
    latency_s: Instant = 0.0

    @property
    def sample_sigma(self) -> float:
        """Standard deviation of one reading from the angle, by the resolution [rad]."""
        return 2.0 * math.pi / self.counts_per_revolution / math.sqrt(12.0) if self.counts_per_revolution else 0.0

    def at_work(self, site: Site) -> SampledSensor[Sequence[Scalar]]:
        """Start the encoders."""
        step = 2.0 * math.pi / self.counts_per_revolution if self.counts_per_revolution else 0.0
        stages = [Shown(math.inf, step)] if step else []
        return SampledSensor(self.rate_hz, self.latency_s, site, lambda ideal: ideal.gimbals, stages)
