"""The two accelerometers of the tilt, with all that a cheap part and its mounting do to them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationInfo, field_validator
from pydantic.dataclasses import dataclass

from cmg_mj.core.types import Forces, IdealReading
from cmg_mj.elementwise import Scalar, clip, digitise
from cmg_mj.inputs.field_types import STRICT, Batched, Instant, NonNegative, OnGrid, Positive, Rate
from cmg_mj.stages.low_pass import low_pass, noise_gain

STANDARD_GRAVITY = 9.80665  # m/s^2, the g of a datasheet's mg
INSIDE_HZ = 1000.0
"""The part's own sampling, at which its low-pass works (MPU-6050: the accelerometer's output rate)."""
NARROWEST_HZ = 1.0
"""No part has a narrower low-pass, and one needs as many samples to settle [Hz]."""
CROSSWISE = [1, 0, 3, 2]
"""Each channel's other axis of the same part."""

MOST_HARMONICS = 20
"""No flywheel's tones beyond this multiple of its speed."""

Share = Annotated[float, Field(gt=-1.0, lt=1.0)]
NoiseSize = Annotated[float, Field(ge=0.0, le=1e6)]
"""No part is noisier than 1 g/rtHz [ug/rtHz], or shaken by more than 1000 g [mg]."""
VibrationFrequency = Annotated[float, Field(ge=0.1, le=1e5)]
Angle = Annotated[float, Field(gt=-45.0, lt=45.0)]


@dataclass(frozen=True, config=STRICT)
class Accelerometer:
    """A pair of accelerometers of the MPU-6050 class (InvenSense PS-MPU-6000A: 400 ug/rtHz, +-2 g, 16384 counts/g).

    The offset is tens of mg before calibration; the default is that of a calibrated sensor, zero. An offset on the
    tangential axes acts like the equilibrium bias e. All other errors of the sensor and its mounting are off by
    default. The datasheet allows a scale error of 3 % and a cross-axis sensitivity of 2 % before calibration.

    A reading gets its errors in this order: vibration, misalignment, cross-axis, scale, offset, noise (white, then
    1/f), range, low-pass, resolution. An overshoot of the low-pass is clipped at the range once more.

    Attributes:
        rate_hz: Sampling rate of both accelerometers.
        noise_density_ug_rthz: One-sided density of the white noise; one sample's sigma is density * sqrt(rate/2).
        bias_mg: Offsets of the tangential axes of the inner and the outer accelerometer [mg].
        range_g: Largest acceleration that a reading shows [g].
        counts_per_g: Resolution; 0 for readings that are not rounded.
        latency_s: Delay from the sampling of a reading to its use by the controller [s].
        scale_error: Relative scale errors of the inner and the outer accelerometer, the same for both axes of each.
        misalignment_deg: Angles by which the inner and the outer accelerometer are turned in the tilting plane,
            positive in the direction of a positive tilt [deg].
        cross_axis: Cross-axis sensitivities of the inner and the outer accelerometer: the share of its other axis that
            each axis shows.
        skew_s: Age of the outer accelerometer's sample when the inner one is sampled, at most one sample period [s].
        bias_instability_ug: Bias instability of each axis: the floor of its Allan deviation, made by 1/f noise [ug].
        bandwidth_hz: Bandwidth of the sensor's second-order low-pass, which runs at 1 kHz; 0 for no low-pass. The
            MPU-6050 has 5, 10, 21, 44, 94 and 184 Hz.
        vibration_mg: RMS of broadband vibration, independent in each axis [mg].
        vibration_band_hz: Half-power frequencies of the broadband vibration, lower and upper [Hz].
        wheel_harmonics_mg: Amplitudes of tones at 1, 2, 3, ... times the speed of each flywheel, in each axis [mg].
    """

    rate_hz: Rate = 200.0
    noise_density_ug_rthz: Annotated[NoiseSize, Batched()] = 400.0
    bias_mg: Annotated[tuple[float, float], Batched()] = (0.0, 0.0)
    range_g: Positive = 2.0
    counts_per_g: NonNegative = 16384.0
    latency_s: Instant = 0.0
    scale_error: tuple[Share, Share] = (0.0, 0.0)
    misalignment_deg: tuple[Angle, Angle] = (0.0, 0.0)
    cross_axis: tuple[Share, Share] = (0.0, 0.0)
    skew_s: Annotated[NonNegative, OnGrid("s")] = 0.0
    bias_instability_ug: NoiseSize = 0.0
    bandwidth_hz: Annotated[float, Field(ge=0.0, lt=INSIDE_HZ / 2.0)] = 0.0
    vibration_mg: Annotated[NoiseSize, Batched()] = 0.0
    vibration_band_hz: tuple[VibrationFrequency, VibrationFrequency] = (20.0, 500.0)
    wheel_harmonics_mg: tuple[NonNegative, ...] = ()

    channels = 4

    @field_validator("skew_s")
    @classmethod
    def _within_a_period(cls, skew_s: float, info: ValidationInfo) -> float:
        rate = info.data.get("rate_hz")
        if rate and skew_s > (1.0 + 1e-9) / rate:
            raise ValueError(f"{skew_s:g} s: at most one sample period, {1.0 / rate:g} s at rate_hz = {rate:g}")
        return skew_s

    @field_validator("bandwidth_hz")
    @classmethod
    def _rate_divides(cls, bandwidth_hz: float, info: ValidationInfo) -> float:
        if 0.0 < bandwidth_hz < NARROWEST_HZ:
            raise ValueError(f"{bandwidth_hz:g} Hz: at least {NARROWEST_HZ:g} Hz, or 0 for no low-pass")
        rate = info.data.get("rate_hz")
        if bandwidth_hz and rate and abs(round(INSIDE_HZ / rate) * rate - INSIDE_HZ) > 1e-6:
            raise ValueError(
                f"a part with a low-pass samples at {INSIDE_HZ:g} Hz, which rate_hz = {rate:g} must divide"
            )
        return bandwidth_hz

    @field_validator("vibration_band_hz")
    @classmethod
    def _rising(cls, band_hz: tuple[float, float]) -> tuple[float, float]:
        low, high = band_hz
        if not low < high:
            raise ValueError(f"{low:g} Hz to {high:g} Hz: the lower end comes first")
        return band_hz

    @field_validator("wheel_harmonics_mg")
    @classmethod
    def _not_too_many(cls, amplitudes: tuple[float, ...]) -> tuple[float, ...]:
        if len(amplitudes) > MOST_HARMONICS:
            raise ValueError(f"{len(amplitudes)} amplitudes: at most {MOST_HARMONICS} harmonics")
        return amplitudes

    @property
    def vibrates(self) -> bool:
        """True if the accelerometers of one world vibrate."""
        return bool(self.vibration_mg) or any(self.wheel_harmonics_mg)

    @property
    def raw_rate_hz(self) -> float:
        """Samples a second that the part takes: more than it delivers if it filters them."""
        return INSIDE_HZ if self.bandwidth_hz else self.rate_hz

    @property
    def raw_sigma(self) -> float:
        """Standard deviation of the white noise of one sample that the part takes [m/s^2]."""
        return self.noise_density_ug_rthz * 1e-6 * STANDARD_GRAVITY * math.sqrt(self.raw_rate_hz / 2.0)

    @property
    def white_noise_sigma(self) -> float:
        """Standard deviation of the white noise of one sample that is delivered [m/s^2]."""
        if not self.bandwidth_hz:
            return self.raw_sigma
        return self.raw_sigma * math.sqrt(noise_gain(self.bandwidth_hz, INSIDE_HZ))

    @property
    def sample_sigma(self) -> float:
        """Standard deviation of one sample with the quantisation, as filters assume it [m/s^2]."""
        step = STANDARD_GRAVITY / self.counts_per_g if self.counts_per_g else 0.0
        return math.hypot(self.white_noise_sigma, step / math.sqrt(12.0))

    @property
    def bias(self) -> tuple[float, float]:
        """Offsets of the tangential axes of the inner and the outer accelerometer [m/s^2]."""
        inner, outer = (bias * 1e-3 * STANDARD_GRAVITY for bias in self.bias_mg)
        return inner, outer

    @property
    def flicker_floor(self) -> float:
        """Floor of the Allan deviation of each axis' 1/f noise [m/s^2]."""
        return self.bias_instability_ug * 1e-6 * STANDARD_GRAVITY

    @property
    def imperfections(self) -> dict[str, float | tuple[float, ...]]:
        """Imperfections that are switched on beyond noise, range and resolution: field -> its value."""
        names = [field.name for field in dataclasses.fields(self)]
        optional = ["bias_mg", *names[names.index("scale_error") :]]
        if not self.vibration_mg:
            optional.remove("vibration_band_hz")
        return {name: value for name in optional if (value := getattr(self, name)) not in (0.0, (0.0, 0.0), ())}

    def constant_errors(self) -> Callable[[Forces], Forces]:
        """Return a function: true specific forces (inner x, z, outer x, z) -> what parts without noise show [m/s^2].

        Floats become a tuple of four floats, an array (4, n_worlds) one of the same shape.
        """
        same_axis, other_axis = [], []  # weights of the two axes in a channel
        parts = zip(self.scale_error, self.misalignment_deg, self.cross_axis, strict=True)
        for scale, misalignment, cross in parts:
            c, s = math.cos(math.radians(misalignment)), math.sin(math.radians(misalignment))
            same_axis += [(1.0 + scale) * (c + cross * s), (1.0 + scale) * (c - cross * s)]
            other_axis += [(1.0 + scale) * (cross * c - s), (1.0 + scale) * (cross * c + s)]
        inner, outer = self.bias
        offsets = [inner, 0.0, outer, 0.0]
        if same_axis == [1.0] * 4 and other_axis == [0.0] * 4:
            column = np.array(np.broadcast_arrays(*offsets)).reshape(4, -1)

            def shifted(forces: Forces) -> Forces:
                if isinstance(forces, np.ndarray):
                    return forces + column
                ix, iz, ox, oz = forces
                return ix + inner, iz, ox + outer, oz

            return shifted
        by_same, by_other, by_one = (
            np.array(np.broadcast_arrays(*weights)).reshape(4, -1) for weights in (same_axis, other_axis, offsets)
        )

        def distorted(forces: Forces) -> Forces:
            if isinstance(forces, np.ndarray):
                return by_same * forces + by_other * forces[CROSSWISE] + by_one
            crossed = [forces[i] for i in CROSSWISE]
            terms = zip(same_axis, forces, other_axis, crossed, offsets, strict=True)
            return tuple(a * x + b * z + c for a, x, b, z, c in terms)

        return distorted

    def make_reading_function(
        self,
        drift: Callable[[], Forces] | None = None,
        vibration: Callable[[IdealReading], Forces] | None = None,
    ) -> Callable[[IdealReading, Sequence[Scalar]], Forces]:
        """Return the parts at work: to be called once for every sample that they take (`raw_rate_hz`).

        Args:
            drift: What the 1/f noise adds to the next sample, four numbers or an array (4, n_worlds) [m/s^2].
            vibration: The true forces with those of the vibration at the next sample [m/s^2].

        Returns:
            A function (ideal reading, standard normals) -> reading: inner x, z, outer x, z [m/s^2]. It remembers its
            low-pass, which starts settled.
        """
        sigma = self.raw_sigma
        limit = self.range_g * STANDARD_GRAVITY
        step = STANDARD_GRAVITY / self.counts_per_g if self.counts_per_g else 0.0
        erring = self.constant_errors()
        filters: list[Callable[[Scalar], Scalar]] = []

        def filtered(number: int, x: Scalar) -> Scalar:
            x = clip(x, -limit, limit)
            if len(filters) <= number:
                filters.append(low_pass(self.bandwidth_hz, INSIDE_HZ, x))
            return filters[number](x)

        def measure(ideal: IdealReading, normal: Sequence[Scalar]) -> Forces:
            forces = erring(vibration(ideal) if vibration else ideal.accelerations)
            wander = drift() if drift else None
            if isinstance(forces, np.ndarray):
                raw = forces + sigma * np.asarray(normal)
                if wander is not None:
                    raw = raw + wander
                if self.bandwidth_hz:
                    raw = filtered(0, raw)
                return digitise(raw, limit, step)
            n0, n1, n2, n3 = normal
            ix, iz, ox, oz = forces
            a, b, c, d = ix + sigma * n0, iz + sigma * n1, ox + sigma * n2, oz + sigma * n3
            if wander is not None:
                a, b, c, d = (reading + more for reading, more in zip((a, b, c, d), wander, strict=True))
            if self.bandwidth_hz:
                a, b, c, d = (filtered(i, reading) for i, reading in enumerate((a, b, c, d)))
            return (
                digitise(a, limit, step),
                digitise(b, limit, step),
                digitise(c, limit, step),
                digitise(d, limit, step),
            )

        return measure
