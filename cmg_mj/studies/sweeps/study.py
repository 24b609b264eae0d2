"""What a sweep is to find out: a scenario, what is varied in it and how, the observers, the worlds."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from cmg_mj.inputs.bundled import find
from cmg_mj.inputs.overrides import assign
from cmg_mj.scenario.schema import ObserverSettings, Scenario, parse_scenario
from cmg_mj.simulation.batch import can_vary_in_batch
from cmg_mj.simulation.experiment import prepare
from cmg_mj.simulation.prepare import load_scenario_plant
from cmg_mj.studies.sweeps.axes import VariedField
from cmg_mj.studies.sweeps.checks import check_axes, check_observers, check_order, check_points, check_worlds
from cmg_mj.studies.sweeps.points import Points, sampled

SamplingDesign = Literal["grid", "sample", "sobol"]
MOST_TRIALS = 1_000_000
"""Beyond it a sweep must be asked for twice (`--yes`)."""
CHUNK = 1024
"""Trials that are computed and kept together: so many fill a batch, and take minutes at most."""
MOST_ALONE = 200
"""So many values of a field that is varied alone are tried before the sweep, at 5 ms each, and the last."""


@dataclass(frozen=True)
class Chunk:
    """Trials of one observer that are computed and kept together.

    Attributes:
        number: Its place among all.
        observer: The observer in the loop.
        trials: (number of the point, world), each.
    """

    number: int
    observer: str
    trials: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Chunks:
    """The chunks of a study by their numbers: a chunk's trials are made when it is asked for."""

    study: SweepStudy

    @property
    def _trials(self) -> int:
        """Of one observer."""
        return self.study.n_points * self.study.worlds

    @property
    def _of_one(self) -> int:
        return -(-self._trials // CHUNK)

    @property
    def count(self) -> int:
        """How many there are, also where that is more than `len` can say."""
        return self._of_one * len(self.study.observers)

    def __len__(self) -> int:
        return self.count

    def __iter__(self) -> Iterator[Chunk]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> Chunk:
        if not 0 <= number < len(self):
            raise IndexError(number)
        observer, piece = divmod(number, self._of_one)
        trials = self.stretch(piece * CHUNK, self.size(number))
        return Chunk(number, self.study.observers[observer], trials)

    def stretch(self, first: int, count: int) -> tuple[tuple[int, int], ...]:
        """So many of an observer's trials from one on, in the order in which they are run."""
        order, worlds = self.study._order, self.study.worlds
        places = (divmod(place, worlds) for place in range(first, first + count))
        return tuple((int(order[at]), world) for at, world in places)

    def size(self, number: int) -> int:
        """How many trials a chunk has."""
        return min(CHUNK, self._trials - number % self._of_one * CHUNK)


@dataclass(frozen=True)
class SweepStudy:
    """A sweep.

    Attributes:
        scenario: What every trial starts from.
        axes: What is varied.
        observers: Those in the loop.
        worlds: Trials a point and observer: world i has the same noise at every point, for every observer.
        design: `grid`: every combination of values. `sample`: a quasi-random design of the ranges and lists.
            `sobol`: one for Sobol indices.
        n: Points of the design; of one for indices that many times the number of axes and two.
        order: Observers, the best first, as someone expects them; how often that holds is counted. No
            trial depends on it.
    """

    scenario: Scenario
    axes: tuple[VariedField, ...]
    observers: tuple[str, ...]
    worlds: int
    design: SamplingDesign = "grid"
    n: int = 0
    order: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """See that it can be one.

        Raises:
            InputError: It cannot.
        """
        check_axes(self.axes, self.design)
        check_worlds(self.worlds)
        check_points(self.design, self.n, len(self.axes))
        check_observers(self.observers)
        if self.order:
            check_order(self.order, self.observers)

    @cached_property
    def points(self) -> Points:
        """What is varied, a point each."""
        if self.design == "grid":
            return Points(self.axes)
        shares = sampled(len(self.axes), self.n, self.scenario.seed, indices=self.design == "sobol")
        return Points(self.axes, shares)

    @property
    def n_points(self) -> int:
        """How many points it has, without drawing them."""
        if self.design == "grid":
            return math.prod(len(axis.values) for axis in self.axes)
        return self.n * (len(self.axes) + 2 if self.design == "sobol" else 1)

    @property
    def cells(self) -> int:
        """Points times observers."""
        return self.n_points * len(self.observers)

    @property
    def trials(self) -> int:
        """How many runs it takes."""
        return self.cells * self.worlds

    @cached_property
    def _order(self) -> np.ndarray:
        """Numbers of the points, those that can run in one batch together, (n_points,)."""
        law = self.scenario.controller.kind
        apart = [field for axis in self.axes for field in axis.fields if not can_vary_in_batch(field, law)]
        if not apart:
            return np.arange(len(self.points))

        def unpooled(number: int) -> list[str]:
            point = self.points[number]
            return [repr(point[field]) for field in apart]

        return np.array(sorted(range(len(self.points)), key=unpooled))

    @property
    def chunks(self) -> Chunks:
        """All trials: those that can run in one batch stand together."""
        return Chunks(self)

    def as_fields(self, scenario: Mapping[str, Any]) -> dict[str, Any]:
        """As a study file says it, with the scenario as given."""
        how: dict[str, Any] = {"observers": list(self.observers), "worlds": self.worlds, "design": self.design}
        if self.design != "grid":
            how["n"] = self.n
        if self.order:
            how["order"] = list(self.order)
        return {"sweep": how, "vary": {axis.written: axis.said() for axis in self.axes}, "scenario": dict(scenario)}


def check_values(study: SweepStudy) -> None:
    """See that every observer can run, that every field exists and takes each of its values by itself.

    An observer's own is tried with every observer. Where nothing else is varied, a value must fit the scenario, too;
    what does not fit together is found when it is run, and costs its own trials alone.

    Raises:
        InputError: One does not.
    """
    plant = load_scenario_plant(study.scenario)
    base = study.scenario.model_copy(update={"open_loop_observers": []})
    for observer in study.observers:
        prepare(base.with_observer(observer), plant)
    fields = base.as_fields()
    for axis in study.axes:
        own = {field.partition(".")[2] for field in axis.fields if field.startswith("observer.")}
        values = axis.values or (axis.low, axis.high)
        for i, value in enumerate(values):
            changed = copy.deepcopy(fields)
            for field in axis.fields:
                assign(changed, field, value, f"--vary {field}")
            scenario = parse_scenario(changed, f"--vary {axis.written}={value}")
            if "plant.model" in axis.fields:
                find("models", str(value), ".xml", f"--vary {axis.written}: plant.model =")
            alone = len(study.axes) == 1 and (i < MOST_ALONE or i == len(values) - 1)
            rig = load_scenario_plant(scenario, plant) if alone else plant
            for observer in study.observers if own else study.observers[: int(alone)]:
                given = dict.fromkeys(own, value)
                its = scenario.observer if observer == base.observer.kind else ObserverSettings(kind=observer, **given)
                prepare(scenario.model_copy(update={"observer": its}), rig)


def counted(n: int, what: str) -> str:
    """Such as `1 world`, `2 worlds`."""
    return f"{n} {what}" if n == 1 else f"{n} {what}s"
