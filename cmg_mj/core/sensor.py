"""A sensor as a value: a chain of stages, sampled at its rate, delivered after its latency; times in physics steps.

A stage is a value too: `init` makes its memory from the first signal, `step` advances it. A signal is a list of
floats (one world), a list of arrays (n_worlds,), or an array (channels, n_worlds).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar, digitise
from cmg_mj.core.errors import InputError
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import IdealReading

_new = tuple.__new__

Signal = Sequence[Scalar] | np.ndarray
Memory = Any
"""A stage's memory between two samples: numbers in tuples and lists."""


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


class Site(NamedTuple):
    """The place of a part in a run."""

    section: str
    """The part's section in a scenario, for messages."""
    timestep: float
    """Physics step [s]."""
    axis: int = 0
    """Number of the axis, on which the noise depends."""

    def steps(self, duration: float, field: str, text: str) -> int:
        """Count the physics steps of a time of the part: see `whole_steps`."""
        return whole_steps(duration, self.timestep, f"{self.section}.{field}", text)


class SensorStage:
    """An effect on a sensor's signal: by default none, and without memory."""

    @property
    def draws(self) -> Mapping[int, int]:
        """Number of a noise stream -> normals that a sample takes of it."""
        return {}

    def init(self, signal: Signal, ideal: IdealReading, tables: Tables) -> Memory:
        """Return the memory before the first sample."""
        return ()

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """Advance by a sample that the part takes.

        Args:
            memory: The memory at the sample before.
            signal: The signal behind the stages before.
            ideal: Readings of perfect sensors at the sample.
            sample: Its number, from 0 on.
            tables: Noise: number of a stream -> function of the sample's number.

        Returns:
            The next memory, and the signal with the effect.
        """
        return memory, signal


def each(formula: Callable[..., Any], signal: Signal, *others: Any) -> Signal:
    """Apply a formula to every channel: once to an array of all, else to one after the other."""
    if type(signal) is np.ndarray:
        return formula(signal, *others)
    return list(map(formula, signal, *others))


def together(formula: Callable[..., tuple], signal: Signal, *others: Any) -> Sequence[Signal]:
    """Apply a formula with several results to every channel; each result is a signal."""
    if type(signal) is np.ndarray:
        return formula(signal, *others)
    return list(zip(*map(formula, signal, *others), strict=True))


@dataclass(frozen=True)
class Digital(SensorStage):
    """Range and resolution of every channel.

    Attributes:
        limit: Largest reading.
        resolution: Step between two readings; 0: they are not rounded.
    """

    limit: float
    resolution: float = 0.0

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """See `SensorStage`."""
        if type(signal) is np.ndarray:
            return memory, digitise(signal, self.limit, self.resolution)
        return memory, list(map(digitise, signal, repeat(self.limit), repeat(self.resolution)))


class SensorState(NamedTuple):
    """A sensor's memory."""

    sample: int
    """Samples that the part has taken."""
    memories: tuple[Memory, ...]
    """Memory of each stage."""
    readings: tuple[Signal, ...]
    """The last readings, the newest first: so many as the latency spans."""
    older: tuple[Signal, ...] = ()
    """The last samples of the part that is read earlier, the newest first."""


@dataclass(frozen=True)
class Sensor:
    """One sensor at work.

    The age of the reading that is delivered at a step is arithmetic on that step: no state has a time in it.

    Attributes:
        signal: Which of the readings of perfect sensors it is, a field of `IdealReading`.
        stages: The effects on it, the first one first.
        period: Physics steps between two readings.
        latency: Physics steps from the sampling of a reading to its delivery.
        inside: Physics steps between the samples that the part takes; 0: it takes those that it delivers.
        settle: Samples before the first one, all of the same reading.
        skew: Physics steps by which the second half of the channels is older than the first.
    """

    signal: str
    stages: tuple[SensorStage, ...]
    period: int
    latency: int = 0
    inside: int = 0
    settle: int = 0
    skew: int = 0

    @cached_property
    def raw(self) -> int:
        """Physics steps between the samples that the part takes."""
        return self.inside or self.period

    @property
    def kept(self) -> int:
        """Number of the last readings that the latency spans."""
        return self.latency // self.period + 2 if self.latency else 1

    @property
    def older_kept(self) -> int:
        """Number of the last samples that the skew spans."""
        return self.skew // self.raw + 1 if self.skew else 0

    @property
    def steps_per_sample(self) -> int:
        """Physics steps between the instants at which it may be due."""
        return math.gcd(self.period, self.raw, self.skew)

    @property
    def draws(self) -> dict[int, int]:
        """Number of each noise stream -> normals that a sample takes of it."""
        return {stream: width for stage in self.stages for stream, width in stage.draws.items()}

    @cached_property
    def _field(self) -> int:
        return IdealReading._fields.index(self.signal)

    @cached_property
    def _is_scalar(self) -> bool:
        return self.signal == "gyro"

    def init(self, ideal: IdealReading, tables: Tables) -> SensorState:
        """Start at a reading: before, the rig stood still.

        Args:
            ideal: Readings of perfect sensors.
            tables: The noise.

        Returns:
            The state, with the first sample taken.
        """
        taken = self.ideal(ideal)
        older = (taken,) * self.older_kept
        memories, signal = self.started(self._joined(taken, older), ideal, tables)
        state = SensorState(1, memories, (signal,) * self.kept, older)
        for _ in range(self.settle):
            state = self._sampled(state, True, ideal, tables)
        return state._replace(readings=state.readings[:1] * self.kept)

    def started(self, signal: Signal, ideal: IdealReading, tables: Tables) -> tuple[tuple[Memory, ...], Signal]:
        """Pass the first sample through the stages: return their memories, and the reading."""
        memories = []
        for stage in self.stages:
            memory, signal = stage.step(stage.init(signal, ideal, tables), signal, ideal, 0, tables)
            memories.append(memory)
        return tuple(memories), signal

    def sample(self, state: SensorState, step: int, ideal: IdealReading, tables: Tables) -> SensorState:
        """Take what is due at a physics step.

        Args:
            state: The state before it.
            step: Number of the physics step.
            ideal: Readings of perfect sensors there.
            tables: The noise.

        Returns:
            The next state.
        """
        if self.skew and (step + self.skew) % self.raw == 0:
            state = state._replace(older=(self.ideal(ideal), *state.older[:-1]))
        if step % self.raw:
            return state
        return self._sampled(state, step % self.period == 0, ideal, tables)

    def _sampled(self, state: SensorState, delivers: bool, ideal: IdealReading, tables: Tables) -> SensorState:
        sample, memories, readings, older = state
        after, signal = self.passed(memories, self._joined(self.ideal(ideal), older), ideal, sample, tables)
        if delivers:
            readings = (signal, *readings[:-1])
        return _new(SensorState, (sample + 1, after, readings, older))

    def passed(
        self, memories: tuple[Memory, ...], signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[tuple[Memory, ...], Signal]:
        """Pass a sample through the stages: return their next memories, and the reading."""
        after = []
        for stage, memory in zip(self.stages, memories, strict=True):
            memory, signal = stage.step(memory, signal, ideal, sample, tables)
            after.append(memory)
        return tuple(after), signal

    def read(self, state: SensorState, step: int) -> Signal:
        """Return the newest reading that has been delivered by a physics step."""
        if not self.latency:
            return state.readings[0]
        return state.readings[step // self.period - (step - self.latency) // self.period]

    def ideal(self, ideal: IdealReading) -> Signal:
        """Return its signal among the readings of perfect sensors."""
        signal = ideal[self._field]
        return (signal,) if self._is_scalar else signal

    def _joined(self, signal: Signal, older: Sequence[Signal]) -> Signal:
        """Return the signal whose second half is as old as the skew."""
        if not older:
            return signal
        late = older[-1]
        half = len(signal) // 2
        if type(signal) is np.ndarray:
            return np.concatenate([signal[:half], late[half:]])
        return [*signal[:half], *late[half:]]


def all_draws(parts: Iterable[Any]) -> dict[int, int]:
    """Put together the `draws` of sensors and stages."""
    return {stream: width for part in parts for stream, width in part.draws.items()}
