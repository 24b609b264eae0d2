"""A sensor at work: a chain of stages, sampled at its rate, delivered after its latency; times on the physics grid."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar, digitise
from cmg_mj.core.errors import InputError
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.types import IdealReading


def whole_steps(duration: float, timestep: float, field: str, text: str) -> int:
    """Count the physics steps of a duration.

    Args:
        duration: Duration [s].
        timestep: Physics step [s].
        field: The scenario field to name in the error.
        text: Its value as the user wrote it.

    Returns:
        The whole number of steps.

    Raises:
        InputError: The duration is no whole number of physics steps.
    """
    ratio = duration / timestep
    steps = round(ratio) if math.isfinite(ratio) else 0
    if abs(steps * timestep - duration) > 1e-9 * max(duration, timestep) + 1e-12 or (duration > 0 and steps == 0):
        raise InputError(
            f"{field} = {text}: not a whole number of physics steps of {timestep:g} s; "
            f"rates must divide {1.0 / timestep:g} Hz and times be multiples of {timestep:g} s"
        )
    return steps


def steps_until(delay: float, timestep: float) -> int:
    """Return the first physics step that is no earlier than a delay [s] after step 0."""
    return math.ceil(delay / timestep - 1e-6)


class Timing(NamedTuple):
    """The times that a stage asks of the sampling of its part."""

    inside: int = 0
    """Physics steps between the samples that the part takes; 0: it takes those that it delivers."""
    grid: int = 0
    """Physics steps that must be a multiple of the grid of instants."""
    settle: int = 0
    """Samples before the first one, all of the same reading."""


SensorStage = Callable[[Any, IdealReading], Any]
"""An effect on a sensor's signal: (signal, readings of perfect sensors) -> the signal with it.

It is called once a sample that the part takes. The signal is that behind the stages before: of accelerometers four
forces, or an array (4, n_worlds). A stage may have a `timing`, and a method `watch(step, period, ideal)` that is called
at every instant, with the physics steps between the samples that the part takes.
"""


class Site(NamedTuple):
    """The place of a part in a run."""

    section: str
    """The part's section in a scenario, for messages."""
    timestep: float
    """Physics step [s]."""
    noise: Callable[[NoiseStream, int], Iterator[Sequence[Scalar]]]
    """Standard normals of a stream: so many a draw, floats or an array (channels, n_worlds)."""

    def steps(self, duration: float, field: str, text: str) -> int:
        """Count the physics steps of a time of the part: see `whole_steps`."""
        return whole_steps(duration, self.timestep, f"{self.section}.{field}", text)


def shown(limit: float, step: float) -> SensorStage:
    """Make the stage of range and resolution of every channel.

    Args:
        limit: Largest reading.
        step: Of the resolution; 0: readings are not rounded.
    """
    limits, steps = repeat(limit), repeat(step)

    def digital(signal: Any, ideal: IdealReading) -> Any:
        if isinstance(signal, np.ndarray):
            return digitise(signal, limit, step)
        return list(map(digitise, signal, limits, steps))

    return digital


class SampledSensor:
    """One sensor at work: it samples at its own rate and delivers after its latency.

    Args:
        rate_hz: Readings a second.
        latency_s: Delay from the sampling of a reading to its delivery [s].
        site: The part's place in the run.
        signal: Which of the readings of perfect sensors it is, a field of `IdealReading`.
        stages: The effects on it, the first one first.

    Attributes:
        steps_per_sample: Physics steps between the instants at which it may be due.
    """

    def __init__(
        self,
        rate_hz: float,
        latency_s: float,
        site: Site,
        signal: str,
        stages: Sequence[SensorStage] = (),
    ) -> None:
        timings = [getattr(stage, "timing", Timing()) for stage in stages]
        self.period = site.steps(1.0 / rate_hz, "rate_hz", f"{rate_hz:g} Hz")
        self._raw = max((timing.inside for timing in timings), default=0) or self.period
        self._settle = sum(timing.settle for timing in timings)
        self.steps_per_sample = math.gcd(self.period, self._raw, *(timing.grid for timing in timings))
        self._watches = [watch for stage in stages if (watch := getattr(stage, "watch", None))]
        self._signal, self._stages = IdealReading._fields.index(signal), stages
        self._latency = steps_until(latency_s, site.timestep)
        self._on_the_way: deque[tuple[int, Any]] = deque()
        self._delivered = None

    def sample(self, step: int, ideal: IdealReading) -> None:
        """Take what is due at a physics step; at the first one, whichever it is, there must be something to show."""
        for watch in self._watches:
            watch(step, self._raw, ideal)
        if self._delivered is None:  # before the start the rig stood still
            for _ in range(self._settle + 1):
                self._delivered = self._measure(ideal)
        elif step % self._raw == 0:
            signal = ideal[self._signal]
            for stage in self._stages:  # as `_measure`, at every tick
                signal = stage(signal, ideal)
            if step % self.period == 0:
                if self._latency:
                    self._on_the_way.append((step + self._latency, signal))
                else:
                    self._delivered = signal

    def _measure(self, ideal: IdealReading) -> Any:
        signal = ideal[self._signal]
        for stage in self._stages:
            signal = stage(signal, ideal)
        return signal

    def read(self, step: int) -> Any:
        """Return the newest sample delivered by a physics step; before the start the rig stood still."""
        while self._on_the_way and self._on_the_way[0][0] <= step:
            self._delivered = self._on_the_way.popleft()[1]
        return self._delivered
