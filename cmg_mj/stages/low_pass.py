"""The low-pass inside a digital sensor: a second-order Butterworth filter at the part's own sampling rate."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationInfo, field_validator
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip
from cmg_mj.core.sensor import Site, Timing
from cmg_mj.core.types import STANDARD_GRAVITY, Forces, IdealReading
from cmg_mj.inputs.types import STRICT
from cmg_mj.stages.pair import PairSettings

INSIDE_HZ = 1000.0
"""The part's own sampling, at which its low-pass works (MPU-6050: the accelerometer's output rate)."""
MIN_BANDWIDTH_HZ = 1.0
"""No part has a narrower low-pass, and one needs as many samples to settle [Hz]."""


@dataclass(frozen=True, config=STRICT)
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
    def inside_text(self) -> str:
        """The bandwidth and the rate inside, as messages show them."""
        return f"{self.bandwidth_hz:g} Hz, sampled at {INSIDE_HZ:g} Hz inside the part"

    @property
    def noise_gain(self) -> float:
        """The variance of white noise behind the low-pass, by that before it."""
        return noise_gain(self.bandwidth_hz, INSIDE_HZ) if self.bandwidth_hz else 1.0


class LowPass:
    """Filters every channel, cut at the range before. It starts settled.

    Args:
        part: The accelerometers.
        site: Their place in the run.
    """

    def __init__(self, part: LowPassSettings, site: Site) -> None:
        # So long a low-pass needs to forget its start, all but 1e-4 of it.
        settle = math.ceil(2.0 * INSIDE_HZ / part.bandwidth_hz)
        self.timing = Timing(inside=site.steps(1.0 / INSIDE_HZ, "bandwidth_hz", part.inside_text), settle=settle)
        self._b, self._a = coefficients(part.bandwidth_hz, INSIDE_HZ)
        self._limit = part.range_g * STANDARD_GRAVITY
        self._memories: list[tuple[Scalar, Scalar]] = []

    def __call__(self, forces: Forces, ideal: IdealReading) -> Forces:
        """Return what the filters show."""
        (b0, b1, b2), (_, a1, a2) = self._b, self._a
        channels = [forces] if isinstance(forces, np.ndarray) else forces
        cut = [clip(x, -self._limit, self._limit) for x in channels]
        if not self._memories:
            self._memories = [((1.0 - b0) * x, (b2 - a2) * x) for x in cut]
        passed = []
        for i, x in enumerate(cut):
            first, second = self._memories[i]
            y = b0 * x + first
            self._memories[i] = b1 * x - a1 * y + second, b2 * x - a2 * y
            passed.append(y)
        return passed[0] if isinstance(forces, np.ndarray) else passed


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
