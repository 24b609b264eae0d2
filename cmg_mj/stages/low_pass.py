"""The low-pass inside a digital sensor: a second-order Butterworth filter at the part's own sampling rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationInfo, field_validator
from pydantic.dataclasses import dataclass as settings

from cmg_mj.core.arrays import Scalar, clip
from cmg_mj.core.sensor import Memory, SensorStage, Signal, Site, each, together
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import STANDARD_GRAVITY, IdealReading
from cmg_mj.inputs.types import STRICT
from cmg_mj.stages.pair import PairSettings

INSIDE_HZ = 1000.0
"""The part's own sampling, at which its low-pass works (MPU-6050: the accelerometer's output rate)."""
MIN_BANDWIDTH_HZ = 1.0
"""No part has a narrower low-pass, and one needs as many samples to settle [Hz]."""


@settings(frozen=True, config=STRICT)
class LowPassSettings(PairSettings):
    """The low-pass inside the accelerometers.

    Attributes:
        bandwidth_hz: Bandwidth of the sensor's second-order low-pass, which runs at 1 kHz; 0 for no low-pass. The
            MPU-6050 has 5, 10, 21, 44, 94 and 184 Hz.
    """

    bandwidth_hz: Annotated[float, Field(ge=0.0, lt=INSIDE_HZ / 2.0)] = 0.0

    @field_validator("bandwidth_hz")
    @classmethod
    def _rate_divides(cls, bandwidth_hz: float, info: ValidationInfo) -> float:
        if 0.0 < bandwidth_hz < MIN_BANDWIDTH_HZ:
            raise ValueError(f"{bandwidth_hz:g} Hz: at least {MIN_BANDWIDTH_HZ:g} Hz, or 0 for no low-pass")
        rate = info.data.get("rate_hz")
        if bandwidth_hz and rate and abs(round(INSIDE_HZ / rate) * rate - INSIDE_HZ) > 1e-6:
            raise ValueError(
                f"a part with a low-pass samples at {INSIDE_HZ:g} Hz, which rate_hz = {rate:g} must divide"
            )
        return bandwidth_hz

    @property
    def inside_hz(self) -> float:
        """Samples a second that the part takes; 0: as many as it delivers."""
        return INSIDE_HZ if self.bandwidth_hz else 0.0

    @property
    def settle_samples(self) -> int:
        """Samples in which the low-pass forgets its start, all but 1e-4 of it; 0 without one."""
        return math.ceil(2.0 * INSIDE_HZ / self.bandwidth_hz) if self.bandwidth_hz else 0

    def inside_steps(self, site: Site) -> int:
        """Count the physics steps between the samples that the part takes; 0: it takes those that it delivers."""
        return site.steps(1.0 / INSIDE_HZ, "bandwidth_hz", self.inside_text) if self.bandwidth_hz else 0

    @property
    def inside_text(self) -> str:
        """The bandwidth and the rate inside, as messages show them."""
        return f"{self.bandwidth_hz:g} Hz, sampled at {INSIDE_HZ:g} Hz inside the part"

    @property
    def noise_gain(self) -> float:
        """The variance of white noise behind the low-pass, by that before it."""
        return noise_gain(self.bandwidth_hz, INSIDE_HZ) if self.bandwidth_hz else 1.0


@dataclass(frozen=True)
class LowPass(SensorStage):
    """Filters every channel, cut at the range before. It starts settled on the first signal.

    Attributes:
        numerator: Coefficients on the samples, the newest first.
        denominator: Coefficients on the results, the newest first, 1 the first of them.
        limit: The range [m/s^2].
    """

    numerator: Sequence[float]
    denominator: Sequence[float]
    limit: float

    def init(self, signal: Signal, ideal: IdealReading, tables: Tables) -> Memory:
        """Return two numbers a channel."""
        b0, _, b2 = self.numerator
        a2 = self.denominator[2]
        cut = each(lambda x: clip(x, -self.limit, self.limit), signal)
        return each(lambda x: (1.0 - b0) * x, cut), each(lambda x: (b2 - a2) * x, cut)

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """See `SensorStage`."""
        one, two, passed = together(self._filtered, signal, *memory)
        return (one, two), passed

    def _filtered(self, x: Scalar, one: Scalar, two: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        b0, b1, b2 = self.numerator
        _, a1, a2 = self.denominator
        cut = clip(x, -self.limit, self.limit)
        y = b0 * cut + one
        return b1 * cut - a1 * y + two, b2 * cut - a2 * y, y


def low_pass(part: LowPassSettings, site: Site) -> LowPass:
    """Make the stage of the low-pass."""
    numerator, denominator = coefficients(part.bandwidth_hz, INSIDE_HZ)
    return LowPass(numerator, denominator, part.range_g * STANDARD_GRAVITY)


def noise_gain(bandwidth_hz: float, rate_hz: float) -> float:
    """Return the variance of white noise after the filter, by that before.

    The bilinear transform makes |H|^2 = 1/(1 + (w/t)^4), w = tan(omega/2), t = tan(pi bandwidth/rate); its mean over
    omega, by partial fractions.

    Args:
        bandwidth_hz: Where the filter has halved the power [Hz].
        rate_hz: Of its samples [Hz].

    Returns:
        The ratio.
    """
    t = math.tan(math.pi * bandwidth_hz / rate_hz)
    return (t**4 + (t - t**3) / math.sqrt(2.0)) / (1.0 + t**4)


def coefficients(bandwidth_hz: float, rate_hz: float) -> list[list[float]]:
    """Return b and a of the filter, the bandwidth and the rate of its samples in Hz."""
    from scipy.signal import butter  # 1 s of import, which only a part with a low-pass needs

    return np.array(butter(2, bandwidth_hz, fs=rate_hz)).tolist()
