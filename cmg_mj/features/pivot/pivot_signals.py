"""The accelerations of a pivot in time: means over intervals, exact and whatever the physics step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.loop import Disturbance, Outside
from cmg_mj.core.noise import NoiseStream, normals
from cmg_mj.features.pivot import Pivot
from cmg_mj.features.pivot.pivot_track import read_track

POINTS_A_PERIOD = 40
"""Points of the noise in a period of its corner, between which it runs straight: its own grid, no sensor's."""

Mean = Callable[[float, float], Scalar]
"""Mean acceleration between two times since a motion's start [m/s^2]."""


class BandLimitedNoise:
    """White noise behind a second-order Butterworth low-pass, of RMS 1, as if it had been on for ever.

    Its points come from the exact discrete form of the filter, whose stationary state has independent parts.

    Args:
        corner_hz: Half-power frequency [Hz].
        seed: The run's seed.
        world_ids: The number of one world, on floats, or the numbers of many, on arrays (n_worlds,).
        stream: The noise stream.
    """

    def __init__(self, corner_hz: float, seed: int, world_ids: int | Sequence[int], stream: int) -> None:
        self._dt = 1.0 / (POINTS_A_PERIOD * corner_hz)
        decay = math.sqrt(0.5) * 2.0 * math.pi * corner_hz * self._dt  # of the filter's poles, -decay +- i decay
        fading, c, s = math.exp(-decay), math.cos(decay), math.sin(decay)
        root = math.sqrt(2.0)
        # Of the position and of the rate over the corner's angular frequency, each of RMS 1.
        self._phi = (fading * (c + s), fading * root * s, -fading * root * s, fading * (c - s))
        a, b, d, e = self._phi
        first = math.sqrt(1.0 - a * a - b * b)
        cross = -(a * d + b * e) / first
        self._spread = (first, cross, math.sqrt(1.0 - d * d - e * e - cross * cross))
        self._source = lambda: normals(seed, world_ids, stream, 2)
        self._begin()

    def _begin(self) -> None:
        self._normals = self._source()
        self._x, self._v = next(self._normals)
        self._point = 0
        self._passed: Scalar = 0.0  # the integral up to the point
        self._next, self._next_v = self._step()

    def _step(self) -> tuple[Scalar, Scalar]:
        (a, b, d, e), (first, cross, second) = self._phi, self._spread
        n, m = next(self._normals)
        return a * self._x + b * self._v + first * n, d * self._x + e * self._v + (cross * n + second * m)

    def velocity(self, time: float) -> Scalar:
        """Integral from the start to a time [s]; a time before the last one asked for begins anew."""
        dt = self._dt
        if time < self._point * dt:
            self._begin()
        while (self._point + 1) * dt < time:
            self._passed = self._passed + 0.5 * dt * (self._x + self._next)
            self._x, self._v = self._next, self._next_v
            self._point += 1
            self._next, self._next_v = self._step()
        since = time - self._point * dt
        return self._passed + since * (self._x + (0.5 * since / dt) * (self._next - self._x))


def _mean_of(velocity: Callable[[float], Scalar]) -> Mean:
    """Make means from an integral, which is asked for times in order."""
    last: tuple[float, Scalar] = (0.0, velocity(0.0))

    def mean(start: float, end: float) -> Scalar:
        nonlocal last
        begin = last[1] if last[0] == start else velocity(start)
        last = end, velocity(end)
        return (last[1] - begin) / (end - start)

    return mean


def _sine(frequency_hz: float, phase_deg: float) -> Mean:
    half, phase = math.pi * frequency_hz, math.radians(phase_deg)

    def mean(start: float, end: float) -> float:
        turned = half * (end - start)
        return math.sin(half * (start + end) + phase) * (math.sin(turned) / turned)

    return mean


def pivot_signal(pivot: Pivot, number: int, seed: int, world_ids: int | Sequence[int]) -> Mean:
    """Make the acceleration of one motion of the pivot.

    Args:
        pivot: The motion.
        number: Its number in the scenario: each has a noise stream of its own.
        seed: The run's seed.
        world_ids: The number of one world, on floats, or the numbers of many, on arrays.

    Returns:
        A function: start and end of an interval of the run [s] -> the mean over it, (n_worlds,) if it differs [m/s^2].

    Raises:
        InputError: The file of a track cannot be read.
    """
    if pivot.kind == "sine":
        unit = _sine(pivot.frequency_hz or 1.0, pivot.phase_deg)
    elif pivot.kind == "step":
        unit = _mean_of(lambda time: time)
    elif pivot.kind == "track":
        unit = _mean_of(read_track(pivot.file or "", pivot.column).velocity)
    else:
        stream = NoiseStream.PIVOT.on_axis(number)
        unit = _mean_of(BandLimitedNoise(pivot.corner_hz or 1.0, seed, world_ids, stream).velocity)
    size, begin, lasts = pivot.size, pivot.start_s, pivot.duration_s

    def mean(start: float, end: float) -> Scalar:
        first, last = max(0.0, start - begin), end - begin
        if lasts is not None:
            last = min(last, lasts)
        if last <= first:
            return 0.0
        share = (last - first) / (end - start)
        return size * unit(first, last) * share

    return mean


class PivotSignals(Disturbance):
    """The acceleration of the pivot in time, the sum of all motions; as a disturbance its mean until the next instant.

    Args:
        pivots: The motions; a size may be an array (n_worlds,).
        directions: Unit vector of each, in the world's axes.
        seed: The run's seed.
        world_ids: The number of one world, or the numbers of many: noise depends on (seed, number) alone.
        timestep: Physics step of the disturbance [s].
    """

    def __init__(
        self,
        pivots: Sequence[Pivot],
        directions: Sequence[Sequence[float]],
        seed: int,
        world_ids: int | Sequence[int],
        timestep: float = 0.0,
    ) -> None:
        self._timestep = timestep
        self._made_from = pivots, directions, seed, world_ids, timestep
        signals = [pivot_signal(pivot, i, seed, world_ids) for i, pivot in enumerate(pivots)]
        self._parts = list(zip(signals, directions, strict=True))

    def __reduce__(self) -> tuple:
        """Copy and pickle what it was made from: it is a function of time."""
        return PivotSignals, self._made_from

    def mean(self, start: float, end: float) -> list[Scalar]:
        """Compute the mean acceleration over an interval of the run [s]: x, y, z, each (n_worlds,) if it differs."""
        total: list[Scalar] = [0.0, 0.0, 0.0]
        for signal, direction in self._parts:
            acceleration = signal(start, end)
            total = [part + along * acceleration for part, along in zip(total, direction, strict=True)]
        return total

    def placed(self, plants: Sequence[Any]) -> Sequence[Any]:
        """See `Disturbance`: gravity changes; many worlds have their own of the batch."""
        return [plants[0].with_own_model()] if len(plants) == 1 else plants

    def at(self, step: int, steps: int) -> Outside:
        """Return the acceleration: see `Disturbance`."""
        return Outside(acceleration=self.mean(step * self._timestep, (step + steps) * self._timestep))
