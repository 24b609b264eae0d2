"""What a sweep is to find out: a scenario, what is varied in it and how, the observers, the worlds."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.experiment import load_rig, prepare
from cmg_mj.overrides import assign
from cmg_mj.pool import pools
from cmg_mj.scenario import as_fields, parse_scenario
from cmg_mj.schema import ObserverSettings, Scenario
from cmg_mj.sweeps.axes import Axis
from cmg_mj.sweeps.points import Points, sampled

Design = Literal["grid", "sample", "sobol"]
MOST_TRIALS = 1_000_000
"""Beyond it a sweep must be asked for twice (`--yes`)."""
CHUNK = 1024
"""Trials that are computed and kept together: so many fill a batch, and take minutes at most."""


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

    study: Study

    @property
    def _trials(self) -> int:
        """Of one observer."""
        return len(self.study.points) * self.study.worlds

    @property
    def _of_one(self) -> int:
        return -(-self._trials // CHUNK)

    def __len__(self) -> int:
        return self._of_one * len(self.study.observers)

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
class Study:
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
    axes: tuple[Axis, ...]
    observers: tuple[str, ...]
    worlds: int
    design: Design = "grid"
    n: int = 0
    order: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """See that design and axes fit.

        Raises:
            InputError: They do not.
        """
        if not self.axes:
            raise InputError("--vary: nothing is varied; give a field, such as --vary plant.equilibrium_bias_deg=0,0.5")
        fields = [field for axis in self.axes for field in axis.fields]
        twice = next((field for i, field in enumerate(fields) if field in fields[:i]), None)
        if twice is not None:
            raise InputError(f"--vary {twice}: given twice")
        for axis in self.axes:
            if axis.is_range and self.design == "grid":
                raise InputError(
                    f"--vary {axis.field}: a range without a count is for --sample and --sobol; write first:last:count"
                )
        if self.design == "sobol" and (self.n < 2 or self.n & (self.n - 1)):
            raise InputError(f"--sobol {self.n}: must be a power of two, such as {_power_near(self.n)}")
        if self.order:
            self._check_order()

    def _check_order(self) -> None:
        said = f"--order {','.join(self.order)}"
        if len(self.order) < 2 or len(set(self.order)) < len(self.order):
            raise InputError(f"{said}: write two observers or more, each once, the best first")
        for name in self.order:
            if name not in self.observers:
                raise InputError(f"{said}: {name} does not run here; --observers are {', '.join(self.observers)}")

    @cached_property
    def points(self) -> Points:
        """What is varied, a point each."""
        if self.design == "grid":
            return Points(self.axes)
        shares = sampled(len(self.axes), self.n, self.scenario.seed, indices=self.design == "sobol")
        return Points(self.axes, shares)

    @property
    def cells(self) -> int:
        """Points times observers."""
        if self.design == "grid":
            points = math.prod(len(axis.values) for axis in self.axes)
        else:
            points = self.n * (len(self.axes) + 2 if self.design == "sobol" else 1)
        return points * len(self.observers)

    @property
    def trials(self) -> int:
        """How many runs it takes."""
        return self.cells * self.worlds

    @cached_property
    def _order(self) -> np.ndarray:
        """Numbers of the points, those that can run in one batch together, (n_points,)."""
        apart = [field for axis in self.axes for field in axis.fields if not pools(field)]
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


def check_values(study: Study) -> None:
    """See that every field exists and takes each of its values by itself; an observer's own with every observer.

    What does not fit together is found when it is run, and costs its own trials alone.

    Raises:
        InputError: One does not.
    """
    fields = as_fields(study.scenario)
    plant = None
    for axis in study.axes:
        for value in axis.values or (axis.low, axis.high):
            changed = copy.deepcopy(fields)
            for field in axis.fields:
                assign(changed, field, value, f"--vary {field}")
            scenario = parse_scenario(changed, f"--vary {axis.written}={value}")
            own = {field.partition(".")[2]: value for field in axis.fields if field.startswith("observer.")}
            if own:
                for observer in study.observers:
                    given = {"kind": observer, **own}
                    plant = plant or load_rig(study.scenario)
                    prepare(scenario.model_copy(update={"observer": ObserverSettings(**given)}), plant)


def _power_near(n: int) -> int:
    return 2 ** max(1, round(math.log2(max(n, 2))))


def counted(n: int, what: str) -> str:
    """Such as `1 world`, `2 worlds`."""
    return f"{n} {what}" if n == 1 else f"{n} {what}s"
