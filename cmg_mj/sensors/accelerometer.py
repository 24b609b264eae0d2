"""The two accelerometers of the tilt, with all that a cheap part and its mounting do to them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

from pydantic.dataclasses import dataclass

from cmg_mj.core.sensor import Digital, Sensor, Site, steps_until
from cmg_mj.core.types import STANDARD_GRAVITY, Forces
from cmg_mj.inputs.types import STRICT, Latency, NonNegative, Rate
from cmg_mj.stages.flicker import FlickerSettings, flicker
from cmg_mj.stages.low_pass import LowPassSettings, low_pass
from cmg_mj.stages.mounting_errors import PERFECT, MountingErrorsSettings, mounting_errors
from cmg_mj.stages.pair import PairSettings, averaged, white
from cmg_mj.stages.skew import SkewSettings
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
        optional = ["bias_mg", *(name for name in names if name not in PairSettings.__dataclass_fields__)]
        if not self.vibration_mg:
            optional.remove("vibration_band_hz")
        return {name: value for name in optional if (value := getattr(self, name)) not in (0.0, (0.0, 0.0), ())}

    def constant_errors(self) -> Callable[[Forces], Forces]:
        """Return a function: true specific forces (inner x, z, outer x, z) -> what parts without noise show [m/s^2]."""
        mixed = mounting_errors(self).mixed
        inner, outer = self.bias

        def erring(forces: Forces) -> Forces:
            ix, iz, ox, oz = mixed(forces)
            return ix + inner, iz, ox + outer, oz

        return erring

    def at_work(self, site: Site) -> Sensor:
        """Make the accelerometers of a run."""
        effects = (
            (self.averaged, averaged),
            (self.vibrates, vibration),
            (self.mounting_weights() != PERFECT, mounting_errors),
            (True, white),
            (self.bias_instability_ug, flicker),
            (self.bandwidth_hz, low_pass),
        )
        stages = [make(self, site) for is_on, make in effects if is_on]
        return Sensor(
            "motion" if self.averaged else "accelerations",
            (*stages, Digital(self.range_g * STANDARD_GRAVITY, self.resolution)),
            period=site.steps(1.0 / self.rate_hz, "rate_hz", f"{self.rate_hz:g} Hz"),
            latency=steps_until(self.latency_s, site.timestep),
            inside=self.inside_steps(site),
            settle=self.settle_samples,
            skew=self.skew_steps(site),
        )


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
    latency_s: Latency = 0.0

    @property
    def resolution(self) -> float:
        """Step between two readings; 0 for readings that are not rounded [rad]."""
        return 2.0 * math.pi / self.counts_per_revolution if self.counts_per_revolution else 0.0

    @property
    def sample_sigma(self) -> float:
        """Standard deviation of one reading from the angle, by the resolution [rad]."""
        return self.resolution / math.sqrt(12.0)

    def at_work(self, site: Site) -> Sensor:
        """Make the encoders of a run."""
        return Sensor(
            "gimbals",
            (Digital(math.inf, self.resolution),),
            period=site.steps(1.0 / self.rate_hz, "rate_hz", f"{self.rate_hz:g} Hz"),
            latency=steps_until(self.latency_s, site.timestep),
        )
