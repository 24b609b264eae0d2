"""Vibration of accelerometers: broadband, and at harmonics of the flywheels' speed."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator
from pydantic.dataclasses import dataclass as settings

from cmg_mj.core.arrays import Scalar, atan2, cos, sin
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.sensor import Memory, SensorStage, Signal, Site
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import STANDARD_GRAVITY, IdealReading
from cmg_mj.inputs.types import STRICT, Batched, NoiseSize, NonNegative
from cmg_mj.stages.pair import PairSettings

VibrationFrequency = Annotated[float, Field(ge=0.1, le=1e5)]

AXES = 4
"""Axes that vibrate: x and z of the inner and of the outer accelerometer."""


@settings(frozen=True, config=STRICT)
class VibrationSettings(PairSettings):
    """Vibration of the accelerometers.

    Attributes:
        vibration_mg: RMS of broadband vibration, independent in each axis [mg].
        vibration_band_hz: Half-power frequencies of the broadband vibration, lower and upper [Hz].
        wheel_harmonics_mg: Amplitudes of tones at 1, 2, 3, ... times the speed of each flywheel, in each axis [mg].
    """

    vibration_mg: Annotated[NoiseSize, Batched()] = 0.0
    vibration_band_hz: tuple[VibrationFrequency, VibrationFrequency] = (20.0, 500.0)
    wheel_harmonics_mg: Annotated[tuple[NonNegative, ...], Field(max_length=20)] = ()

    @field_validator("vibration_band_hz")
    @classmethod
    def _rising(cls, band_hz: tuple[float, float]) -> tuple[float, float]:
        low, high = band_hz
        if not low < high:
            raise ValueError(f"{low:g} Hz to {high:g} Hz: the lower end comes first")
        return band_hz

    @property
    def vibrates(self) -> bool:
        """True if the accelerometers of any world vibrate."""
        return bool(np.any(self.vibration_mg)) or any(self.wheel_harmonics_mg)


@dataclass(frozen=True)
class BroadbandVibration:
    """White noise behind the band-pass b s/(s^2 + b s + w^2), of RMS 1, as if it had been on for ever.

    Its half-power frequencies are the band's ends; beyond them it falls by 6 dB an octave. Samples come from the exact
    discrete form, so that their statistics are those of the continuous vibration at any rate, with all its aliases.

    Attributes:
        stream: Number of the noise stream.
        band_hz: Both ends of the band [Hz].
        dt: Sample period [s].
    """

    stream: int
    band_hz: tuple[float, float]
    dt: float

    width = 2 * AXES

    def init(self, tables: Tables) -> Memory:
        """Return the band-pass' integral, times w, and the band-pass, of each axis."""
        start = tables[self.stream](0)
        return list(start[:AXES]), list(start[AXES:])

    def step(self, memory: Memory, sample: int, tables: Tables) -> Memory:
        """Advance by a sample."""
        (a, b, d, e), (first, cross, second) = self._shares
        drawn = tables[self.stream](sample + 1)
        integrals, values = [], []
        for x, v, n, m in zip(*memory, drawn[:AXES], drawn[AXES:], strict=True):
            integrals.append(a * x + b * v + first * n)
            values.append(d * x + e * v + (cross * n + second * m))
        return integrals, values

    @cached_property
    def _shares(self) -> tuple[tuple[float, float, float, float], tuple[float, float, float]]:
        """Shares of integral and band-pass in their next values, and of the normals."""
        (low, high), dt = self.band_hz, self.dt
        w, half = 2.0 * math.pi * math.sqrt(low * high), math.pi * (high - low)
        apart = cmath.sqrt(half * half - w * w)
        slow, fast = (-w * w / (half + apart), -half - apart)  # the poles; their difference cancels nothing
        mean = (0.5 * (cmath.exp(slow * dt) + cmath.exp(fast * dt))).real
        if abs(apart) * dt > 1e-6:
            slope = ((cmath.exp(slow * dt) - cmath.exp(fast * dt)) / (2.0 * apart)).real
        else:
            slope = dt * math.exp(-half * dt)
        a, b, e = mean + half * slope, w * slope, mean - half * slope
        first = math.sqrt(max(1.0 - a * a - b * b, 0.0))
        cross = (a * b - b * e) / first if first else 0.0
        second = math.sqrt(max(1.0 - b * b - e * e - cross * cross, 0.0))
        return (a, b, -b, e), (first, cross, second)


@dataclass(frozen=True)
class WheelTones:
    """Tones at whole multiples of each flywheel's speed, which follow it: their phase is its angle, times the multiple.

    The phase at the start differs by axis, wheel and multiple.

    Attributes:
        stream: Number of the noise stream.
        amplitudes: The amplitude of each multiple, from 1 on.
        dt: Sample period [s].
    """

    stream: int
    amplitudes: Sequence[float]
    dt: float

    width = 2

    def init(self, rates: Sequence[Scalar], tables: Tables) -> Memory:
        """Return each wheel's angle, its rate, and the phases at the start."""
        drawn = map(tables[self.stream], range(AXES * len(rates) * len(self.amplitudes)))
        starts = [atan2(n, m) for n, m in drawn]
        return [0.0 * rate for rate in rates], list(rates), starts

    def step(self, memory: Memory, rates: Sequence[Scalar]) -> Memory:
        """Advance by a sample, at the flywheels' rates there; they run straight between samples [rad/s]."""
        angles, before, starts = memory
        means = [0.5 * self.dt * (then + now) for then, now in zip(before, rates, strict=True)]
        return [angle + mean for angle, mean in zip(angles, means, strict=True)], list(rates), starts

    def tones(self, memory: Memory) -> list[Scalar]:
        """Return the sum of the tones in each axis."""
        angles, _, starts = memory
        phases, total = iter(starts), [0.0 * angles[0]] * AXES
        for angle in angles:
            for multiple, amplitude in enumerate(self.amplitudes, 1):
                s, c = sin(multiple * angle), cos(multiple * angle)
                for i in range(AXES):
                    phase = next(phases)
                    total[i] = total[i] + amplitude * (s * cos(phase) + c * sin(phase))
        return total


@dataclass(frozen=True)
class Vibration(SensorStage):
    """Vibration added to the true specific forces.

    Attributes:
        rms: RMS of the broadband vibration of each axis, a float or an array (n_worlds,) [m/s^2].
        broadband: The broadband vibration; None if there is none in any world.
        tones: The flywheels' tones, of amplitudes in m/s^2; None if there are none.
    """

    rms: Scalar
    broadband: BroadbandVibration | None
    tones: WheelTones | None

    @property
    def draws(self) -> dict[int, int]:
        """See `SensorStage`."""
        return {source.stream: source.width for source in (self.broadband, self.tones) if source is not None}

    def init(self, signal: Signal, ideal: IdealReading, tables: Tables) -> Memory:
        """Return the memories of both."""
        broadband = () if self.broadband is None else self.broadband.init(tables)
        tones = () if self.tones is None else self.tones.init(ideal.wheels, tables)
        return broadband, tones

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """See `SensorStage`."""
        broadband, tones = memory
        added = [0.0] * AXES
        if self.broadband is not None:
            broadband = self.broadband.step(broadband, sample, tables)
            added = [self.rms * value for value in broadband[1]]
        if self.tones is not None and ideal.wheels:
            if sample:
                tones = self.tones.step(tones, ideal.wheels)
            added = [value + tone for value, tone in zip(added, self.tones.tones(tones), strict=True)]
        if isinstance(signal, np.ndarray):
            return (broadband, tones), signal + np.array(added)
        return (broadband, tones), [force + more for force, more in zip(signal, added, strict=True)]


def vibration(part: VibrationSettings, site: Site) -> Vibration:
    """Make the stage of vibration."""
    dt, milli_g = 1.0 / part.raw_rate_hz, 1e-3 * STANDARD_GRAVITY
    broadband = tones = None
    if np.any(part.vibration_mg):
        stream = NoiseStream.VIBRATION.on_axis(site.axis)
        broadband = BroadbandVibration(stream, part.vibration_band_hz, dt)
    if any(part.wheel_harmonics_mg):
        amplitudes = [milli_g * amplitude for amplitude in part.wheel_harmonics_mg]
        tones = WheelTones(NoiseStream.WHEEL_TONES.on_axis(site.axis), amplitudes, dt)
    return Vibration(milli_g * part.vibration_mg, broadband, tones)
