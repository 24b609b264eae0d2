"""The controllers of a rig's axes and what stands between them, as one value with pure functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Protocol

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axis import AxisControl, Deciding, Known, Sampled, Tick, require_one_period
from cmg_mj.core.errors import InputError
from cmg_mj.core.one_by_one import for_worlds
from cmg_mj.core.sensor import Memory, all_draws
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import IdealReading, MultiAxisReading

_new = tuple.__new__

Readings = IdealReading | MultiAxisReading
"""Readings of perfect sensors: of one axis, or of several."""


class AxesOrders(NamedTuple):
    """The orders of a tick: `told`, `rates` and `known` have one an axis."""

    told: Sequence[Scalar]
    """The commands that observers are told [rad/s]."""
    rates: Sequence[Scalar]
    """The commands of the servos [rad/s]."""
    known: Sequence[Known]
    """The knowledge of the next measurements, one an axis."""
    setpoints: Sequence[Scalar] = ()
    """Controls of the stages' `actuators`, one after the other."""


class Sums(Protocol):
    """Sums over the ticks of a run, of one or many worlds."""

    def add(self, time: float, q: Any, power: Any, running: Any) -> None:
        """Take a tick: its time [s], joint positions, the power of each actuator [W], which worlds have not ended."""
        ...

    def figures(self, world: int) -> Mapping[str, Any]:
        """Return the figures of a world."""
        ...


class AxesStage:
    """An effect between the axes, after their decisions, once a control tick. Stages act one after the other."""

    @property
    def actuators(self) -> Sequence[int]:
        """Actuators beside the gimbals that it moves."""
        return ()

    @property
    def draws(self) -> Mapping[int, int]:
        """Number of a noise stream -> normals that a tick takes of it."""
        return {}

    @property
    def tables(self) -> Mapping[Any, Callable[[int], Sequence[float]]]:
        """Tables that it looks up by the physics step: key -> function."""
        return {}

    def sums(self, plant: Any, n_worlds: int) -> Sums | None:
        """Make what sums up figures of a run of so many worlds; None if it has none."""
        return None

    def series(self, plant: Any) -> Callable[[Any, Any], Mapping[str, Any]] | None:
        """Make a function of an axis and a trajectory: more lines of a recording, by their paths; None for none."""
        return None

    def init(self, readings: MultiAxisReading, tables: Tables) -> Memory:
        """Return the memory before the first tick, from the readings there."""
        return ()

    def step(
        self,
        memory: Memory,
        step: int,
        orders: AxesOrders,
        ticks: Sequence[Tick],
        readings: MultiAxisReading,
        tables: Tables,
    ) -> tuple[Memory, AxesOrders]:
        """Order what the stages before have ordered, with the effect.

        Args:
            memory: The memory.
            step: Number of the physics step.
            orders: The orders of the stages before; of the first one the laws' commands, and nothing known.
            ticks: The decision of each axis.
            readings: Readings of perfect sensors.
            tables: Noise and the stages' own tables.

        Returns:
            The next memory, and the orders.
        """
        return memory, orders


class RigDeciding(NamedTuple):
    """The memory of a rig's decisions."""

    axes: tuple[Deciding, ...]
    between: tuple[Memory, ...] = ()


class Decision(NamedTuple):
    """The outcome of a control tick."""

    ticks: tuple[Tick, ...]
    """One an axis; u is the command that observers are told."""
    rates: tuple[Scalar, ...]
    """Rates at which each axis' gimbals are turned, behind the servos' stages [rad/s]."""
    setpoints: Sequence[Scalar] = ()
    """Controls of the rig's `actuators`."""


@dataclass(frozen=True)
class RigControl:
    """The controllers of a rig's axes, and the stages between them.

    Attributes:
        axes: The controllers, of one control period.
        between: The stages, the first one first.

    Raises:
        InputError: The control periods differ, or two stages move the same actuator.
    """

    axes: tuple[AxisControl, ...]
    between: tuple[AxesStage, ...] = ()

    def __post_init__(self) -> None:
        require_one_period(self.axes)
        if len(set(self.actuators)) < len(self.actuators):
            raise InputError("two stages between the axes move the same actuator")

    @property
    def period(self) -> int:
        """Physics steps between two control ticks."""
        return self.axes[0].period

    @cached_property
    def steps_per_sample(self) -> int:
        """Physics steps between the instants at which anything may be due."""
        return math.gcd(self.period, *(sensor.steps_per_sample for axis in self.axes for sensor in axis.at_work))

    @cached_property
    def common_period(self) -> int:
        """Physics steps after which the same is due again."""
        return math.lcm(self.period, *(sensor.period for axis in self.axes for sensor in axis.at_work))

    @cached_property
    def actuators(self) -> tuple[int, ...]:
        """Actuators beside the gimbals that the stages move."""
        return tuple(actuator for stage in self.between for actuator in stage.actuators)

    @property
    def draws(self) -> dict[int, int]:
        """Number of each noise stream -> normals that a sample takes of it."""
        sensors = [sensor for axis in self.axes for sensor in axis.at_work]
        return all_draws([*sensors, *self.between])

    @property
    def tables(self) -> dict[Any, Callable[[int], Sequence[float]]]:
        """The tables that the stages look up by the physics step."""
        return {key: table for stage in self.between for key, table in stage.tables.items()}

    def for_worlds(self) -> RigControl:
        """Return the rig that takes arrays: users' observers and laws step each world by itself."""
        axes = [
            replace(axis, observers=tuple(map(for_worlds, axis.observers)), law=for_worlds(axis.law))
            for axis in self.axes
        ]
        return replace(self, axes=tuple(axes))

    def init(self, readings: Readings, tables: Tables) -> tuple[Sampled, ...]:
        """Start the sensors at a reading of perfect ones."""
        pairs = zip(self.axes, ideals_of(readings), strict=True)
        return tuple(axis.init(ideal, tables) for axis, ideal in pairs)

    def sample(
        self, sampled: tuple[Sampled, ...], step: int, readings: Readings, tables: Tables
    ) -> tuple[Sampled, ...]:
        """Take the samples that are due at a physics step.

        Args:
            sampled: The sensors' memory, an axis each; empty at the first step, at which the sensors start.
            step: Number of the physics step.
            readings: Readings of perfect sensors.
            tables: The noise.

        Returns:
            The next memory.
        """
        if not sampled:
            return self.init(readings, tables)
        parts = zip(self.axes, sampled, ideals_of(readings), strict=True)
        return tuple([axis.sample(before, step, ideal, tables) for axis, before, ideal in parts])

    def update(
        self,
        sampled: tuple[Sampled, ...],
        deciding: RigDeciding | None,
        step: int,
        readings: Readings,
        tables: Tables,
    ) -> tuple[tuple[Sampled, ...], RigDeciding, Decision]:
        """Take samples and decisions of a control tick, and turn the gimbals: `sample`, `decide`, then `drive`."""
        sampled = self.sample(sampled, step, readings, tables)
        axes, ticks = self.decide(sampled, deciding, step, readings)
        before = None if deciding is None else deciding.between
        after, decision = self.drive(axes, before, step, ticks, readings, tables)
        return sampled, after, decision

    def decide(
        self, sampled: tuple[Sampled, ...], deciding: RigDeciding | None, step: int, readings: Readings
    ) -> tuple[tuple[Deciding, ...], tuple[Tick, ...]]:
        """Take the decision of each axis: return the next memories, and the ticks.

        Args:
            sampled: The sensors' memory, an axis each.
            deciding: The memory of the decisions; None at the first tick.
            step: Number of the physics step.
            readings: Readings of perfect sensors.

        Raises:
            RunStopped: An observer or a law failed.
        """
        befores = [None] * len(self.axes) if deciding is None else deciding.axes
        after, ticks = [], []
        for axis, part, before, ideal in zip(self.axes, sampled, befores, ideals_of(readings), strict=True):
            memory, tick = axis.decide(before, step, axis.delivered(part, step), ideal.rate)
            after.append(memory)
            ticks.append(tick)
        return tuple(after), tuple(ticks)

    def drive(
        self,
        axes: Sequence[Deciding],
        between: Sequence[Memory] | None,
        step: int,
        ticks: Sequence[Tick],
        readings: Readings,
        tables: Tables,
    ) -> tuple[RigDeciding, Decision]:
        """Turn the gimbals as the axes have decided and the stages between them order.

        Args:
            axes: Memories of the axes after their decisions.
            between: Memories of the stages; None at the first tick.
            step: Number of the physics step.
            ticks: The decisions.
            readings: Readings of perfect sensors.
            tables: Noise and tables.

        Returns:
            The next memory, and the outcome.
        """
        told = rates = [tick.u for tick in ticks]
        setpoints: Sequence[Scalar] = ()
        memories: tuple[Memory, ...] = ()
        if self.between:
            assert isinstance(readings, MultiAxisReading)
            if between is None:
                between = [stage.init(readings, tables) for stage in self.between]
            orders = AxesOrders(told, rates, [Known()] * len(ticks))
            after = []
            for stage, memory in zip(self.between, between, strict=True):
                memory, orders = stage.step(memory, step, orders, ticks, readings, tables)
                after.append(memory)
            memories = tuple(after)
            told, rates, _, setpoints = orders
            ticks = [tick._replace(u=u) for tick, u in zip(ticks, told, strict=True)]
            axes = [before._replace(known=known) for before, known in zip(axes, orders.known, strict=True)]
        driven, turned = [], []
        for axis, before, u, rate in zip(self.axes, axes, told, rates, strict=True):
            memory, behind = axis.drive(before._replace(held=u), rate)
            driven.append(memory)
            turned.append(behind)
        deciding = _new(RigDeciding, (tuple(driven), memories))
        return deciding, _new(Decision, (tuple(ticks), tuple(turned), setpoints))


def ideals_of(readings: Readings) -> Sequence[IdealReading]:
    """Return the readings of each axis."""
    return readings.axes if isinstance(readings, MultiAxisReading) else (readings,)
