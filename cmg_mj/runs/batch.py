"""Worlds in one batch: what they have in common, and what they differ in as arrays (n_worlds,)."""

from __future__ import annotations

import copy
import dataclasses
import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, TypeAlias, TypeVar

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.errors import InputError
from cmg_mj.core.one_by_one import for_worlds
from cmg_mj.core.types import State, as_estimate, extra_signals, needs
from cmg_mj.inputs.types import Batched, NoEffect, marked_fields
from cmg_mj.laws import LAW_CLASSES, Law
from cmg_mj.observers import OBSERVER_CLASSES, Measurement, Observer
from cmg_mj.plant.plant import Plant
from cmg_mj.runs.disturbances import Outsides, outsides
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.schema import Scenario
from cmg_mj.sensors import Sensors

T = TypeVar("T")
BATCHED_FIELDS = marked_fields(Scenario, Batched)
"""Fields that worlds of one batch may differ in. Every other decides what is computed, or when."""
UNUSED = marked_fields(Scenario, NoEffect)
"""Fields on which no number of a run depends."""


BatchKey: TypeAlias = tuple[tuple[str, bool, Hashable], ...]
"""All that worlds of one batch have in common: what it is in words, whether it is the observer's alone, its value.

Worlds with equal keys can run together; those whose keys differ in the observer's parts, with an observer of their own.
"""


def plant_structure(plant: Plant) -> Hashable:
    """Find what a plant has in common with all that may run with it."""
    options = plant.model.opt
    return options.timestep, int(options.integrator), tuple(plant.joint_names), plant.joint_kinds


def key_parts(scenario: Scenario, design: Design, prefix: str = "") -> Iterator[tuple[str, bool, Hashable]]:
    """Find what worlds of an axis' experiment have in common with all that may run with them; prefix names the axis."""
    law, observer = scenario.controller.kind, scenario.observer.kind
    for field, value in _leaves(scenario.as_fields()):
        section = field.partition(".")[0]
        if section not in UNUSED and not can_vary_in_batch(field, law):
            yield prefix + field, section == "observer", repr(value)  # by which 1, 1.0 and true are different
    _, model, noise = design.constructor_arguments
    yield f"{prefix}the reduced model", False, model
    if "noise" in OBSERVER_CLASSES.takes(observer):
        yield f"{prefix}the sensors' noise, which {observer} is told,", True, noise
    if "noise" in LAW_CLASSES.takes(law):
        yield f"{prefix}the noise that the law is told", False, noise


def _leaves(fields: Any, at: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(fields, Mapping):
        parts: Any = fields.items()
    elif isinstance(fields, list) and fields and isinstance(fields[0], Mapping):
        parts = enumerate(fields)
    else:
        yield at, fields
        return
    for name, value in parts:
        yield from _leaves(value, f"{at}.{name}" if at else name)


def can_vary_in_batch(field: str, law: str) -> bool:
    """Return whether worlds of one batch may differ in a field, under a law of this kind."""
    name = re.sub(r"\.\d+", "", field)
    mark = next((mark for batched, mark in BATCHED_FIELDS.items() if f"{name}.".startswith(f"{batched}.")), None)
    if mark is None or mark.law_field is None:
        return mark is not None
    return mark.law_field in getattr(LAW_CLASSES.find(law), "arrays", ())


def batched(worlds: Sequence[tuple[Law, Scenario]]) -> tuple[Law, Sensors, Outsides]:
    """Law, sensors and what acts from outside of many worlds as one, with arrays (n_worlds,) where they differ.

    Args:
        worlds: The law and the scenario of each. The laws differ in their array fields alone.
    """
    laws, scenarios = zip(*worlds, strict=True)
    arrays = getattr(laws[0], "arrays", ())
    law = copy.copy(laws[0]) if arrays else laws[0]
    for name in arrays:
        object.__setattr__(law, name, stack_worlds([getattr(world_law, name) for world_law in laws]))
    acting = [outsides(scenario) for scenario in scenarios]
    outside = {name: stack_worlds([world[name] for world in acting]) for name in acting[0]}
    return law, stack_worlds([scenario.sensors for scenario in scenarios]), outside


def neighbours(worlds: Sequence[int]) -> list[slice]:
    """Find the places in a batch of groups of so many worlds, one beside the other."""
    ends = np.cumsum(worlds).tolist()
    return [slice(end - count, end) for end, count in zip(ends, worlds, strict=True)]


class BatchedObservers:
    """Observers that stand beside each other in one batch, each in worlds of its own.

    Args:
        parts: An observer, and how many worlds it has, in the batch's order. All name the same extra signals.
    """

    def __init__(self, parts: Sequence[tuple[Observer, int]]) -> None:
        self.extra_signals = extra_signals(parts[0][0])
        self.needs = needs(parts[0][0])
        observers, worlds = zip(*parts, strict=True)
        self._parts = list(zip(map(for_worlds, observers), neighbours(worlds), strict=True))

    def init(self, y: Measurement) -> list[State]:
        """Return each observer's state at the first sample."""
        return [observer.init(_measurement(y, worlds)) for observer, worlds in self._parts]

    def step(self, state: list[State], y: Measurement, u: Scalar) -> tuple[list[State], Any]:
        """Advance each by one sample period; estimates are arrays (n_worlds,)."""
        states, estimates = [], []
        for observer_state, (observer, worlds) in zip(state, self._parts, strict=True):
            held = u[worlds]
            observer_state, estimate = observer.step(observer_state, _measurement(y, worlds), held)
            states.append(observer_state)
            estimates.append([np.broadcast_to(part, held.shape) for part in estimate])
        return states, as_estimate([np.concatenate(parts) for parts in zip(*estimates, strict=True)])


def _measurement(y: Measurement, worlds: slice) -> Measurement:
    """Take the measurement of some of the worlds."""
    gyro = y.gyro[worlds] if np.ndim(y.gyro) else None  # type: ignore[index]
    return Measurement(y.y1[worlds], y.y2[worlds], y.acceleration[worlds], gyro)  # type: ignore[index]


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
        names = [field.name for field in dataclasses.fields(first)]
        return _with_fields(first, {name: stack_worlds([getattr(value, name) for value in values]) for name in names})
    if isinstance(first, tuple):
        return tuple(map(stack_worlds, zip(*values, strict=True)))  # type: ignore[call-overload,return-value]
    if not all(type(value) in (int, float) for value in values):
        raise InputError("must have one value for all worlds of a batch")
    return np.array(values, dtype=float)  # type: ignore[return-value]


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
        return tuple(world_value(part, world) for part in value)  # type: ignore[return-value]
    if not dataclasses.is_dataclass(value):
        return value
    parts = {field.name: world_value(getattr(value, field.name), world) for field in dataclasses.fields(value)}
    if all(part is getattr(value, name) for name, part in parts.items()):
        return value
    return _with_fields(value, parts)


def _with_fields(like: Any, fields: Mapping[str, Any]) -> Any:
    """Make a frozen dataclass like another without checking its fields anew."""
    instance = object.__new__(type(like))
    for name, value in fields.items():
        object.__setattr__(instance, name, value)
    return instance
