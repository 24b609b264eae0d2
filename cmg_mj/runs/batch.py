"""Worlds in one batch: what they have in common, and what they differ in as arrays (n_worlds,)."""

from __future__ import annotations

import copy
import dataclasses
from collections import namedtuple
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple, TypeVar

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.controller import KnownPlant
from cmg_mj.core.errors import InputError, nearest
from cmg_mj.core.types import State, extra_signals
from cmg_mj.inputs.types import Batched, NoEffect, marked_fields
from cmg_mj.laws import LAW_CLASSES, Law
from cmg_mj.observers import OBSERVER_CLASSES, Estimate, Measurement, Observer
from cmg_mj.plant.plant import Plant
from cmg_mj.runs.disturbances import Outsides, outsides
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.schema import Scenario
from cmg_mj.sensors import Sensors
from cmg_mj.stages.backlash import backlash

T = TypeVar("T")
BATCHED_FIELDS = marked_fields(Scenario, Batched)
"""Fields that worlds of one batch may differ in. Every other decides what is computed, or when."""
UNUSED = frozenset(marked_fields(Scenario, NoEffect))
"""Fields on which no number of a run depends."""


class KeyField(NamedTuple):
    """One of the things that worlds of one batch have in common.

    Attributes:
        words: A field of the scenario, or the part in words.
        axis: The axis, of several.
        is_of_observer: Whether the part changes neither the physics nor the sensors nor the law.
    """

    words: str
    axis: str
    is_of_observer: bool = False

    def __str__(self) -> str:
        return f"axes.{self.axis}.{self.words}" if self.axis else self.words


@dataclass(frozen=True)
class BatchKey:
    """All that worlds of one batch have in common: worlds with equal keys can run together."""

    parts: tuple[tuple[KeyField, Hashable], ...]

    def first_difference(self, other: BatchKey) -> KeyField | None:
        """Return the first part in which two keys differ."""
        a, b = dict(self.parts), dict(other.parts)
        return next((part for part in (*a, *b) if a.get(part) != b.get(part)), None)

    def without_observer(self) -> BatchKey:
        """Return the key of worlds that may also differ in their observer."""
        return BatchKey(tuple((part, value) for part, value in self.parts if not part.is_of_observer))


class PlantStructure(NamedTuple):
    """Common properties of the plants of one batch."""

    timestep: float
    integrator: int
    joints: tuple[str, ...]
    joint_kinds: tuple[str, ...]


class AxisPart(NamedTuple):
    """An axis of an experiment."""

    scenario: Scenario
    design: Design
    axis: str
    """Name of the axis; empty on a plant of one axis."""


def batch_key(parts: Sequence[AxisPart]) -> BatchKey:
    """Find what worlds of an experiment, given by its axes, have in common with all that may run with them."""
    return BatchKey(tuple(part for axis_part in parts for part in _key_parts(*axis_part)))


def _key_parts(scenario: Scenario, design: Design, axis: str) -> Iterator[tuple[KeyField, Hashable]]:
    law = scenario.controller.kind
    for field, value in _leaves(scenario.as_fields()):
        if field.partition(".")[0] not in UNUSED and not can_vary_in_batch(field, law):
            yield KeyField(field, axis, field.partition(".")[0] == "observer"), hashable(value)
    _, model, noise = design.constructor_arguments
    yield KeyField("the reduced model", axis), model
    observer = scenario.observer.kind
    if "noise" in OBSERVER_CLASSES.takes(observer):
        yield KeyField(f"the sensors' noise, which {observer} is told,", axis, is_of_observer=True), noise
    if "noise" in LAW_CLASSES.takes(law):
        yield KeyField("the noise that the law is told", axis), noise


def _leaves(fields: Any, at: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(fields, list) and fields and isinstance(fields[0], Mapping):
        fields = {str(i): part for i, part in enumerate(fields)}
    if not isinstance(fields, Mapping):
        yield at, fields
        return
    for name, value in fields.items():
        yield from _leaves(value, f"{at}.{name}" if at else name)


def hashable(value: Any) -> Hashable:
    """Return a value of a field as a key, by which 1, 1.0 and true are different."""
    if isinstance(value, Mapping):
        return tuple((name, hashable(item)) for name, item in value.items())
    if isinstance(value, (list, tuple)):
        return tuple(map(hashable, value))
    return type(value), value if isinstance(value, Hashable) else repr(value)


def can_vary_in_batch(field: str, law: str) -> bool:
    """Return whether worlds of one batch may differ in a field, under a law of this kind."""
    parts = [part for part in field.split(".") if not part.isdecimal()]
    names = [".".join(parts[: i + 1]) for i in range(len(parts))]
    mark = next((BATCHED_FIELDS[name] for name in names if name in BATCHED_FIELDS), None)
    if mark is None or mark.law_field is None:
        return mark is not None
    return mark.law_field in getattr(LAW_CLASSES.find(law), "arrays", ())


def varied_settings(vary: Mapping[str, Sequence[Any] | np.ndarray], scenario: Scenario) -> list[dict[str, Any]]:
    """Read the settings of each world: see `Experiment.with_varied`.

    Raises:
        InputError: There is no such field, or the lists differ in length.
    """
    lists = [values.tolist() if isinstance(values, np.ndarray) else values for values in vary.values()]
    if not lists or any(isinstance(values, str) or not isinstance(values, Sequence) for values in lists):
        raise InputError('vary: must be lists of values by field, such as {"equilibrium_bias_deg": [0.0, 0.5]}')
    if len({len(values) for values in lists}) > 1:
        raise InputError(f"vary: {', '.join(vary)} must have as many values each, one a world")
    of_plant = {field.name for field in dataclasses.fields(scenario.plant)}
    for name in vary:
        if "." not in name and name not in of_plant and name not in Scenario.model_fields:
            raise InputError(f"vary: {name!r}: no field of [plant]; {nearest(name, of_plant)}")
    names = [f"plant.{name}" if name in of_plant else name for name in vary]
    return [dict(zip(names, row, strict=True)) for row in zip(*lists, strict=True)]


def plant_structure(plant: Plant) -> PlantStructure:
    """Find what a plant has in common with all that may run with it."""
    options = plant.model.opt
    return PlantStructure(options.timestep, int(options.integrator), tuple(plant.joint_names), plant.joint_kinds)


def stack_known_plants(plant: Plant, plants: Sequence[Plant], axis: int) -> KnownPlant:
    """Combine the properties that a controller of many worlds knows of an axis.

    Args:
        plant: The plant with that axis alone.
        plants: The plant of each world.
        axis: The number of the axis.
    """
    tilt = stack_worlds([world_plant.axes[axis].radial_tilt for world_plant in plants])
    gap = stack_worlds([world_plant.backlash for world_plant in plants])
    return plant.interface._replace(tilt=tilt, servos=backlash(gap))


def require_same_structure(plants: Sequence[Plant], worlds: int, scenario_plant: Plant | None = None) -> None:
    """Refuse plants that cannot run in one batch, or of which there is not one a world."""
    if not plants or len(plants) != worlds:
        raise InputError(f"run_many: {worlds} worlds and {len(plants)} plants; give at least one, and as many of each")
    different = {*plants, *([scenario_plant] if scenario_plant else [])}
    if len({plant_structure(plant) for plant in different}) > 1:
        raise InputError(
            "run_many: the plants must have the scenario's joints and timestep_s, and one integrator in common"
        )


def batched(worlds: Sequence[tuple[Law, Scenario]]) -> tuple[Law, Sensors, Outsides]:
    """Law, sensors and what acts from outside of many worlds as one, with arrays (n_worlds,) where they differ.

    Args:
        worlds: The law and the scenario of each.
    """
    laws, scenarios = zip(*worlds, strict=True)
    acting = [outsides(scenario) for scenario in scenarios]
    outside = {name: stack_worlds([world[name] for world in acting]) for name in acting[0]}
    sensors = stack_worlds([scenario.sensors for scenario in scenarios])
    return _batched_law(laws), sensors, outside


class BatchedObservers:
    """Observers that stand beside each other in one batch, each in worlds of its own.

    Args:
        parts: An observer, and how many worlds it has, in the batch's order. All name the same extra signals.
    """

    def __init__(self, parts: Sequence[tuple[Observer, int]]) -> None:
        self.extra_signals = extra_signals(parts[0][0])
        self._estimate: Any = namedtuple("Estimate", ("x1", "x2", "x3", *self.extra_signals))
        ends = np.cumsum([worlds for _, worlds in parts]).tolist()
        self._parts = [
            (observer, slice(end - worlds, end)) for (observer, worlds), end in zip(parts, ends, strict=True)
        ]
        self._shapes = [(worlds,) for _, worlds in parts]

    def init(self, y: Measurement) -> list[State]:
        """Return each observer's state at the first sample."""
        return [observer.init(_measurement(y, worlds)) for observer, worlds in self._parts]

    def step(self, state: list[State], y: Measurement, u: Scalar) -> tuple[list[State], Estimate]:
        """Advance each by one sample period; estimates are arrays (n_worlds,)."""
        steps = [
            observer.step(observer_state, _measurement(y, worlds), u[worlds])
            for observer_state, (observer, worlds) in zip(state, self._parts, strict=True)
        ]
        estimates = [
            [np.broadcast_to(part, shape) for part in estimate]
            for (_, estimate), shape in zip(steps, self._shapes, strict=True)
        ]
        whole = self._estimate(*(np.concatenate(parts) for parts in zip(*estimates, strict=True)))
        return [observer_state for observer_state, _ in steps], whole


def _measurement(y: Measurement, worlds: slice) -> Measurement:
    """Take the measurement of some of the worlds."""
    y1, y2 = y
    return Measurement(y1[worlds], y2[worlds], y.acceleration[worlds])  # type: ignore[index]


def batched_open_loop_observers(designs: Sequence[Design]) -> dict[str, Observer]:
    """Make the open-loop observers of many worlds, each for the noise of its own world's sensors.

    Args:
        designs: The design of each world; all name the same open-loop observers.

    Returns:
        The observers by name: one for all worlds, or one for each neighbouring group of worlds with equal noise.
    """
    groups = [list(group) for _, group in groupby(designs, key=lambda design: design.constructor_arguments)]
    if len(groups) == 1:
        return designs[0].open_loop_observers()
    observers = [group[0].open_loop_observers() for group in groups]
    return {
        name: BatchedObservers([(made[name], len(group)) for made, group in zip(observers, groups, strict=True)])
        if "noise" in OBSERVER_CLASSES.takes(name)
        else observer
        for name, observer in observers[0].items()
    }


def unique(items: Sequence[T]) -> list[T]:
    """Return each of some things once."""
    return list({id(item): item for item in items}.values())


def _batched_law(laws: Sequence[Law]) -> Law:
    """Return one law for a law of each world; the laws differ in their array fields alone."""
    law = laws[0]
    arrays = {
        name: stack_worlds([getattr(world_law, name) for world_law in laws]) for name in getattr(law, "arrays", ())
    }
    if all(values is getattr(law, name) for name, values in arrays.items()):
        return law
    batched = copy.copy(law)
    for name, values in arrays.items():
        object.__setattr__(batched, name, values)
    return batched


T = TypeVar("T")


def stack_worlds(values: Sequence[T]) -> T:
    """Stack the values of the worlds into one value.

    Args:
        values: A world each: numbers, or tuples or frozen dataclasses of such.

    Returns:
        The value itself where all are equal; where numbers differ, an array (n_worlds,). No field is checked anew.

    Raises:
        InputError: The worlds differ in something that is no number.
    """
    first: Any = values[0]
    if all(value is first or value == first for value in values):
        return first
    if dataclasses.is_dataclass(first):
        fields = {}
        for field in dataclasses.fields(first):
            try:
                fields[field.name] = stack_worlds([getattr(value, field.name) for value in values])
            except InputError as error:
                raise InputError(f"{field.name}: {error}") from error
        return _with_fields(type(first), fields)  # type: ignore[return-value]
    if isinstance(first, tuple) and {len(value) for value in values} == {len(first)}:  # type: ignore[arg-type]
        return tuple(map(stack_worlds, zip(*values, strict=True)))  # type: ignore[call-overload,return-value]
    if not all(type(value) in (int, float) for value in values):
        raise InputError("must have one value for all worlds of a batch")
    return np.array(values, dtype=float)  # type: ignore[return-value]


def unstack(value: T, worlds: int) -> list[T]:
    """Return the value of each world, from a value that is stacked or not."""
    first = world_value(value, 0)
    return [first] * worlds if first is value else [world_value(value, world) for world in range(worlds)]


def world_value(value: T, world: int) -> T:
    """Return a stacked value's value in one world.

    Args:
        value: What `stack_worlds` returned.
        world: The world's index.

    Returns:
        The value, on floats.
    """
    if isinstance(value, np.ndarray):
        return value[world].item()
    if isinstance(value, tuple):
        parts = tuple(world_value(part, world) for part in value)
        return value if all(a is b for a, b in zip(parts, value, strict=True)) else parts  # type: ignore[return-value]
    if not dataclasses.is_dataclass(value):
        return value
    parts = {field.name: world_value(getattr(value, field.name), world) for field in dataclasses.fields(value)}
    if all(part is getattr(value, name) for name, part in parts.items()):
        return value
    return _with_fields(type(value), parts)


def _with_fields(cls: type[T], fields: Mapping[str, Any]) -> T:
    """Make a frozen dataclass without checking its fields anew."""
    instance = object.__new__(cls)
    for name, value in fields.items():
        object.__setattr__(instance, name, value)
    return instance
