"""Vibration of accelerometers: broadband, and at harmonics of the flywheels' speed."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, atan2, cos, sin
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.sensor import SensorStage, Site
from cmg_mj.core.types import STANDARD_GRAVITY, Forces, IdealReading
from cmg_mj.inputs.types import STRICT, Batched, NoiseSize, NonNegative
from cmg_mj.stages.pair import PairSettings

VibrationFrequency = Annotated[float, Field(ge=0.1, le=1e5)]

AXES = 4
"""Axes that vibrate: x and z of the inner and of the outer accelerometer."""


@dataclass(frozen=True, config=STRICT)
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


class BroadbandVibration:
    """White noise behind the band-pass b s/(s^2 + b s + w^2), of RMS 1, as if it had been on for ever.

    Its half-power frequencies are the band's ends; beyond them it falls by 6 dB an octave. Samples come from the exact
    discrete form, so that their statistics are those of the continuous vibration at any rate, with all its aliases.

    Args:
        band_hz: Both ends of the band [Hz].
        dt: Sample period [s].
        noise: Standard normals, `channels` a sample.
    """

    channels = 2 * AXES

    def __init__(self, band_hz: tuple[float, float], dt: float, noise: Iterator[Sequence[Scalar]]) -> None:
        low, high = band_hz
        w, half = 2.0 * math.pi * math.sqrt(low * high), math.pi * (high - low)
        apart = cmath.sqrt(half * half - w * w)
        slow, fast = (-w * w / (half + apart), -half - apart)  # the poles; their difference cancels nothing
        mean = (0.5 * (cmath.exp(slow * dt) + cmath.exp(fast * dt))).real
        if abs(apart) * dt > 1e-6:
            slope = ((cmath.exp(slow * dt) - cmath.exp(fast * dt)) / (2.0 * apart)).real
        else:
            slope = dt * math.exp(-half * dt)
        # Of the band-pass' integral, times w, and of the band-pass, each of RMS 1.
        a, b, e = mean + half * slope, w * slope, mean - half * slope
        self._phi = (a, b, -b, e)
        first = math.sqrt(max(1.0 - a * a - b * b, 0.0))
        cross = (a * b - b * e) / first if first else 0.0
        self._spread = (first, cross, math.sqrt(max(1.0 - b * b - e * e - cross * cross, 0.0)))
        self._noise = noise
        start = next(noise)
        self._integral, self._value = list(start[:AXES]), list(start[AXES:])

    def advance(self) -> list[Scalar]:
        """Return the next sample of each axis."""
        (a, b, d, e), (first, cross, second) = self._phi, self._spread
        drawn = next(self._noise)
        for i in range(AXES):
            x, v, n, m = self._integral[i], self._value[i], drawn[i], drawn[AXES + i]
            self._integral[i] = a * x + b * v + first * n
            self._value[i] = d * x + e * v + (cross * n + second * m)
        return list(self._value)


class WheelTones:
    """Tones at whole multiples of each flywheel's speed, which follow it: their phase is its angle, times the multiple.

    Args:
        harmonics: The amplitude of each multiple, from 1 on.
        dt: Sample period [s].
        noise: Standard normals, two a number: the phase at the start differs by axis, wheel and multiple.
    """

    def __init__(self, harmonics: Sequence[float], dt: float, noise: Iterator[Sequence[Scalar]]) -> None:
        self._harmonics, self._dt, self._noise = harmonics, dt, noise
        self._angles: list[Scalar] = []
        self._rates: Sequence[Scalar] = ()
        self._starts: list[Scalar] = []

    def advance(self, rates: Sequence[Scalar]) -> list[Scalar]:
        """Return the next sample of each axis, at the flywheels' rates there, one a wheel [rad/s]."""
        if not self._angles:
            self._angles, self._rates = [0.0 * rate for rate in rates], rates
            draws = (next(self._noise) for _ in range(AXES * len(rates) * len(self._harmonics)))
            self._starts = [atan2(n, m) for n, m in draws]
        else:  # the rate runs straight between samples
            pairs = zip(self._angles, self._rates, rates, strict=True)
            self._angles = [angle + 0.5 * self._dt * (before + now) for angle, before, now in pairs]
            self._rates = rates
        starts, total = iter(self._starts), [0.0 * self._angles[0]] * AXES
        for angle in self._angles:
            for multiple, amplitude in enumerate(self._harmonics, 1):
                s, c = sin(multiple * angle), cos(multiple * angle)
                for i in range(AXES):
                    start = next(starts)
                    total[i] = total[i] + amplitude * (s * cos(start) + c * sin(start))
        return total


def vibration(part: VibrationSettings, site: Site) -> SensorStage:
    """Make the stage that adds the vibration to the true specific forces."""
    dt, milli_g = 1.0 / part.raw_rate_hz, 1e-3 * STANDARD_GRAVITY
    rms, is_broad = milli_g * part.vibration_mg, np.any(part.vibration_mg)
    numbers = site.noise(NoiseStream.VIBRATION, BroadbandVibration.channels)
    broadband = BroadbandVibration(part.vibration_band_hz, dt, numbers)
    amplitudes = [milli_g * amplitude for amplitude in part.wheel_harmonics_mg]
    tones = WheelTones(amplitudes, dt, site.noise(NoiseStream.WHEEL_TONES, 2))

    def add(forces: Forces, ideal: IdealReading) -> Forces:
        added = [rms * part for part in broadband.advance()] if is_broad else [0.0] * AXES
        if amplitudes and ideal.wheels:
            added = [part + tone for part, tone in zip(added, tones.advance(ideal.wheels), strict=True)]
        if isinstance(forces, np.ndarray):
            return forces + np.array(added)
        return [force + part for force, part in zip(forces, added, strict=True)]

    return add
