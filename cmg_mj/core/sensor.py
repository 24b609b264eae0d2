"""A sensor at work: a chain of stages, sampled at its rate, delivered after its latency; times on the physics grid."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from cmg_mj.core.arrays import Scalar, digitise
from cmg_mj.core.errors import InputError
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.types import Forces, IdealReading

Reading = TypeVar("Reading")
"""A sensor's reading: a number, a number for each gimbal, or the forces of the accelerometers."""


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


class SensorStage(Protocol):
    """An effect on a sensor's signal.

    A stage may have a `timing`, and a method `watch(step, period, ideal)` that is called at every instant of its
    part, with the physics steps between the samples that the part takes.
    """

    def __call__(self, signal: Any, ideal: IdealReading, /) -> Any:
        """Return the signal with the effect, once a sample that the part takes.

        Args:
            signal: The signal behind the stages before: four forces, or an array (4, n_worlds), of accelerometers.
            ideal: The readings of perfect sensors.
        """
        ...


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


class White:
    """Constant offsets and white noise of the channels of a pair of accelerometers.

    Args:
        bias: Offsets of the tangential axes of the inner and the outer accelerometer [m/s^2].
        sigma: Standard deviation of a sample [m/s^2].
        noise: Standard normals, four a sample.
    """

    def __init__(self, bias: tuple[Scalar, Scalar], sigma: Scalar, noise: Iterator[Sequence[Scalar]]) -> None:
        self._inner, self._outer = bias
        self._offsets = np.array(np.broadcast_arrays(bias[0], 0.0, bias[1], 0.0)).reshape(4, -1)
        self._sigma, self._noise = sigma, noise

    def __call__(self, forces: Forces, ideal: IdealReading) -> Forces:
        """Add offset and noise."""
        normal, sigma = next(self._noise), self._sigma
        if isinstance(forces, np.ndarray):
            return forces + self._offsets + sigma * np.asarray(normal)
        n0, n1, n2, n3 = normal
        ix, iz, ox, oz = forces
        return ix + self._inner + sigma * n0, iz + sigma * n1, ox + self._outer + sigma * n2, oz + sigma * n3


class Shown:
    """Range and resolution of every channel.

    Args:
        limit: Largest reading.
        step: Of the resolution; 0: readings are not rounded.
    """

    def __init__(self, limit: float, step: float) -> None:
        self._limit, self._step = limit, step

    def __call__(self, signal: Any, ideal: IdealReading) -> Any:
        """Limit and round."""
        limit, step = self._limit, self._step
        if isinstance(signal, np.ndarray):
            return digitise(signal, limit, step)
        return [digitise(x, limit, step) for x in signal]


class SampledSensor(Generic[Reading]):
    """One sensor at work: it samples at its own rate and delivers after its latency.

    Args:
        rate_hz: Readings a second.
        latency_s: Delay from the sampling of a reading to its delivery [s].
        site: The part's place in the run.
        take: Takes the part's signal out of the readings of perfect sensors.
        stages: The effects on it, the first one first.

    Attributes:
        steps_per_sample: Physics steps between the instants at which it may be due.
    """

    _newest: Reading
    _delivered: Reading

    def __init__(
        self,
        rate_hz: float,
        latency_s: float,
        site: Site,
        take: Callable[[IdealReading], Any],
        stages: Sequence[SensorStage] = (),
    ) -> None:
        timings = [getattr(stage, "timing", Timing()) for stage in stages]
        self.period = site.steps(1.0 / rate_hz, "rate_hz", f"{rate_hz:g} Hz")
        self._raw = max((timing.inside for timing in timings), default=0) or self.period
        self._settle = sum(timing.settle for timing in timings)
        self.steps_per_sample = math.gcd(self.period, self._raw, *(timing.grid for timing in timings))
        self._watches = [stage.watch for stage in stages if hasattr(stage, "watch")]  # type: ignore[attr-defined]
        self._take, self._stages = take, stages
        self._latency = steps_until(latency_s, site.timestep)
        self._on_the_way: deque[tuple[int, Reading]] = deque()
        self._is_first, self._has_delivered = True, False

    def sample(self, step: int, ideal: IdealReading) -> None:
        """Take what is due, at a physics step that is a multiple of `steps_per_sample`, or at the first one."""
        for watch in self._watches:
            watch(step, self._raw, ideal)
        is_first, self._is_first = self._is_first, False
        if step % self._raw and not is_first:
            return
        for _ in range(self._settle if is_first else 0):  # before the start the rig stood still
            self._measure(ideal)
        signal = self._take(ideal)
        for stage in self._stages:
            signal = stage(signal, ideal)
        if step % self.period == 0 or is_first:
            self._newest = signal
            if self._latency:
                self._on_the_way.append((step + self._latency, signal))

    def _measure(self, ideal: IdealReading) -> None:
        signal = self._take(ideal)
        for stage in self._stages:
            signal = stage(signal, ideal)

    def read(self, step: int) -> Reading:
        """Return the newest sample delivered by a physics step; before the start the rig stood still."""
        if not self._latency:
            return self._newest
        while self._on_the_way and (self._on_the_way[0][0] <= step or not self._has_delivered):
            self._delivered = self._on_the_way.popleft()[1]
            self._has_delivered = True
        return self._delivered
