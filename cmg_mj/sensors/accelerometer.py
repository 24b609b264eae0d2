"""The two accelerometers of the tilt, with all that a cheap part and its mounting do to them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Annotated

from pydantic.dataclasses import dataclass

from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.sensor import SampledSensor, SensorStage, Shown, Site, White
from cmg_mj.core.types import STANDARD_GRAVITY, Forces
from cmg_mj.inputs.field_types import (
    STRICT,
    Batched,
    Instant,
    NoiseSize,
    NonNegative,
    Positive,
    Rate,
)
from cmg_mj.stages.flicker import FlickerSettings, flicker
from cmg_mj.stages.low_pass import LowPassSettings, low_pass_stage
from cmg_mj.stages.mounting_errors import MountingErrors, MountingErrorsSettings, mounting_errors
from cmg_mj.stages.skew import SkewSettings, skew
from cmg_mj.stages.vibration import VibrationSettings, vibration


@dataclass(frozen=True, config=STRICT)
class PairSettings:
    """Sampling, white noise, offsets, range and resolution of the accelerometers.

    Attributes:
        rate_hz: Sampling rate of both accelerometers.
        noise_density_ug_rthz: One-sided density of the white noise; one sample's sigma is density * sqrt(rate/2).
        bias_mg: Offsets of the tangential axes of the inner and the outer accelerometer [mg].
        range_g: Largest acceleration that a reading shows [g].
        counts_per_g: Resolution; 0 for readings that are not rounded.
        latency_s: Delay from the sampling of a reading to its use by the controller [s].
    """

    rate_hz: Rate = 200.0
    noise_density_ug_rthz: Annotated[NoiseSize, Batched()] = 400.0
    bias_mg: Annotated[tuple[float, float], Batched()] = (0.0, 0.0)
    range_g: Positive = 2.0
    counts_per_g: NonNegative = 16384.0
    latency_s: Instant = 0.0


@dataclass(frozen=True, config=STRICT)
class Accelerometer(
    VibrationSettings, LowPassSettings, FlickerSettings, SkewSettings, MountingErrorsSettings, PairSettings
):
    """A pair of accelerometers of the MPU-6050 class (InvenSense PS-MPU-6000A: 400 ug/rtHz, +-2 g, 16384 counts/g).

    The offset is tens of mg before calibration; the default is that of a calibrated sensor, zero. An offset on the
    tangential axes acts like the equilibrium bias e. All other errors of the sensor and its mounting are off by
    default. The datasheet allows a scale error of 3 % and a cross-axis sensitivity of 2 % before calibration.

    A reading gets its errors in this order: vibration, misalignment, cross-axis, scale, offset, noise (white, then
    1/f), range, low-pass, resolution. An overshoot of the low-pass is clipped at the range once more.
    """  # each base has the fields of an effect, in the file of its stage

    channels = 4

    @property
    def raw_rate_hz(self) -> float:
        """Samples a second that the part takes: more than it delivers if it filters them."""
        return self.inside_hz or self.rate_hz

    @property
    def raw_sigma(self) -> float:
        """Standard deviation of the white noise of one sample that the part takes [m/s^2]."""
        return self.noise_density_ug_rthz * 1e-6 * STANDARD_GRAVITY * math.sqrt(self.raw_rate_hz / 2.0)

    @property
    def white_noise_sigma(self) -> float:
        """Standard deviation of the white noise of one sample that is delivered [m/s^2]."""
        return self.raw_sigma * math.sqrt(self.noise_gain)

    @property
    def resolution(self) -> float:
        """Step between two readings; 0 for readings that are not rounded [m/s^2]."""
        return STANDARD_GRAVITY / self.counts_per_g if self.counts_per_g else 0.0

    @property
    def sample_sigma(self) -> float:
        """Standard deviation of one sample with the quantisation, as filters assume it [m/s^2]."""
        return math.hypot(self.white_noise_sigma, self.resolution / math.sqrt(12.0))

    @property
    def bias(self) -> tuple[float, float]:
        """Offsets of the tangential axes of the inner and the outer accelerometer [m/s^2]."""
        inner, outer = (bias * 1e-3 * STANDARD_GRAVITY for bias in self.bias_mg)
        return inner, outer

    @property
    def imperfections(self) -> dict[str, float | tuple[float, ...]]:
        """Imperfections that are switched on beyond noise, range and resolution: field -> its value."""
        names = [field.name for field in dataclasses.fields(self)]
        optional = ["bias_mg", *names[names.index("scale_error") :]]
        if not self.vibration_mg:
            optional.remove("vibration_band_hz")
        return {name: value for name in optional if (value := getattr(self, name)) not in (0.0, (0.0, 0.0), ())}

    def constant_errors(self) -> Callable[[Forces], Forces]:
        """Return a function: true specific forces (inner x, z, outer x, z) -> what parts without noise show [m/s^2]."""
        mixed = MountingErrors(*self.mounting_weights())
        inner, outer = self.bias

        def shown(forces: Forces) -> Forces:
            ix, iz, ox, oz = mixed(forces)
            return ix + inner, iz, ox + outer, oz

        return shown

    def at_work(self, site: Site) -> SampledSensor[Forces]:
        """Start the accelerometers."""
        stages = [stage for make in PAIR if (stage := make(self, site)) is not None]
        return SampledSensor(self.rate_hz, self.latency_s, site, lambda ideal: ideal.accelerations, stages)


def white(part: Accelerometer, site: Site) -> SensorStage:
    """Make the stage of offsets and white noise."""
    return White(part.bias, part.raw_sigma, site.noise(NoiseStream.ACCELEROMETER, part.channels))


def shown(part: Accelerometer, site: Site) -> SensorStage:
    """Make the stage of range and resolution."""
    return Shown(part.range_g * STANDARD_GRAVITY, part.resolution)


PAIR: tuple[Callable[[Accelerometer, Site], SensorStage | None], ...] = (
    *(skew, vibration, mounting_errors, white, flicker, low_pass_stage, shown),
)
"""The effects on the accelerometers, the first one first: each makes its stage, or None where it is off."""
