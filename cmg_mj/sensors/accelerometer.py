"""The two accelerometers of the tilt, with all that a cheap part and its mounting do to them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.sensor import SampledSensor, SensorStage, Shown, Site
from cmg_mj.core.types import Forces
from cmg_mj.inputs.types import STRICT, Instant, NonNegative, Rate
from cmg_mj.stages.flicker import FlickerSettings, flicker
from cmg_mj.stages.low_pass import LowPassSettings, low_pass_stage
from cmg_mj.stages.mounting_errors import MountingErrors, MountingErrorsSettings, mounting_errors
from cmg_mj.stages.pair import shown, white
from cmg_mj.stages.skew import SkewSettings, skew
from cmg_mj.stages.vibration import VibrationSettings, vibration


@dataclass(frozen=True, config=STRICT)
class Accelerometer(VibrationSettings, LowPassSettings, FlickerSettings, SkewSettings, MountingErrorsSettings):
    """A pair of accelerometers of the MPU-6050 class (InvenSense PS-MPU-6000A: 400 ug/rtHz, +-2 g, 16384 counts/g).

    The offset is tens of mg before calibration; the default is that of a calibrated sensor, zero. An offset on the
    tangential axes acts like the equilibrium bias e. All other errors of the sensor and its mounting are off by
    default. The datasheet allows a scale error of 3 % and a cross-axis sensitivity of 2 % before calibration.

    A reading gets its errors in this order: vibration, misalignment, cross-axis, scale, offset, noise (white, then
    1/f), range, low-pass, resolution. An overshoot of the low-pass is clipped at the range once more.
    """  # each base has the fields of an effect, in the file of its stage

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

        def erring(forces: Forces) -> Forces:
            ix, iz, ox, oz = mixed(forces)
            return ix + inner, iz, ox + outer, oz

        return erring

    def at_work(self, site: Site) -> SampledSensor[Forces]:
        """Start the accelerometers."""
        stages = [stage for make in PAIR if (stage := make(self, site)) is not None]
        return SampledSensor(self.rate_hz, self.latency_s, site, lambda ideal: ideal.accelerations, stages)


PAIR: tuple[Callable[[Accelerometer, Site], SensorStage | None], ...] = (
    *(skew, vibration, mounting_errors, white, flicker, low_pass_stage, shown),
)
"""The effects on the accelerometers, the first one first: each makes its stage, or None where it is off."""


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
        stages: list[SensorStage] = [Shown(math.inf, step)] if step else []
        return SampledSensor(self.rate_hz, self.latency_s, site, lambda ideal: ideal.gimbals, stages)
