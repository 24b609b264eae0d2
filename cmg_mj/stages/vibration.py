"""Vibration of accelerometers: broadband, and at harmonics of the flywheels' speed."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from cmg_mj.core.types import Forces, IdealReading
from cmg_mj.elementwise import Scalar, atan2, cos, sin

AXES = 4
"""Axes that vibrate: x and z of the inner and of the outer accelerometer."""


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


def vibration(
    broadband: BroadbandVibration | None, rms: Scalar, tones: WheelTones | None
) -> Callable[[IdealReading], Forces] | None:
    """Make the function that adds vibration to each sample of the specific forces.

    Args:
        broadband: Vibration of RMS 1, if there is any.
        rms: Its RMS, (n_worlds,) if it differs [m/s^2].
        tones: Tones of the flywheels, if there are any.

    Returns:
        A function: the ideal reading -> inner x, z, outer x, z, as the reading has them; None without vibration.
    """
    if broadband is None and tones is None:
        return None

    def with_vibration(ideal: IdealReading) -> Forces:
        added: list[Scalar] = [0.0] * AXES
        if broadband is not None:
            added = [rms * part for part in broadband.advance()]
        if tones is not None and ideal.wheels:
            added = [part + tone for part, tone in zip(added, tones.advance(ideal.wheels), strict=True)]
        forces = ideal.accelerations
        if isinstance(forces, np.ndarray):
            return forces + np.array(added)
        return tuple(force + part for force, part in zip(forces, added, strict=True))

    return with_vibration
