"""The study of a sweep: a scenario, what is varied in it and how, the observers, the worlds."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from cmg_mj.controllers.laws import LAW_CLASSES
from cmg_mj.core.types import law_needs
from cmg_mj.errors import InputError
from cmg_mj.inputs.files import find
from cmg_mj.inputs.overrides import assign
from cmg_mj.results.baselines import RATES
from cmg_mj.scenario.schema import ObserverSettings, Scenario, parse_scenario
from cmg_mj.simulation.batch import can_vary_in_batch
from cmg_mj.simulation.experiment import prepare
from cmg_mj.simulation.prepare import load_scenario_plant
from cmg_mj.studies.sweeps.axes import FieldValue, VariedField
from cmg_mj.studies.sweeps.checks import check_axes, check_observers, check_order, check_points, check_worlds
from cmg_mj.studies.sweeps.points import Points, sampled

SamplingDesign = Literal["grid", "sample", "sobol"]
MOST_TRIALS = 1_000_000
"""Beyond it a sweep must be asked for twice (`--yes`)."""
CHUNK = 1024
"""Trials of a chunk: so many fill a batch, and take minutes at most."""
BASELINE_LOOP = "linear"
"""Observer that runs where a baseline's trials have the true rate in the loop; nothing depends on it."""
BASELINE_SETTINGS = {"feedback": "truth", "angle_source": "measured", "bias_trim_s": 0.0}
"""Fields of [controller] of a baseline's loop: with others the loop would depend on `BASELINE_LOOP`."""
MOST_ALONE = 200
"""Values of a field that is varied alone that are tried before the sweep, at 5 ms each; the last one is, too."""


def sampling(sample: int | None, sobol: int | None, prefix: str = "") -> tuple[SamplingDesign, int] | None:
    """Return the design of `sample` or `sobol` and its number of points; None without either.

    Args:
        sample: Number of points of a quasi-random design.
        sobol: Rows of a design for Sobol indices.
        prefix: What the user writes before both names: `--` on the command line.

    Raises:
        InputError: Both are there.
    """
    if sample is not None and sobol is not None:
        raise InputError(f"{prefix}sample and {prefix}sobol: one of them")
    if sobol is not None:
        return "sobol", sobol
    return None if sample is None else ("sample", sample)


@dataclass(frozen=True)
class Chunk:
    """Trials of one observer that are computed and kept together.

    Attributes:
        number: Place among all chunks.
        observer: The observer in the loop.
        trials: (number of the point, world) of each trial.
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
        """Trials of one observer."""
        return self.study.n_points * self.study.worlds

    @property
    def _per_observer(self) -> int:
        return -(-self._trials // CHUNK)

    @property
    def count(self) -> int:
        """Number of chunks, also where that is more than `len` can say."""
        return self._per_observer * len(self.study.observers)

    def __len__(self) -> int:
        return self.count

    def __iter__(self) -> Iterator[Chunk]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> Chunk:
        if not 0 <= number < len(self):
            raise IndexError(number)
        observer, piece = divmod(number, self._per_observer)
        trials = self.stretch(piece * CHUNK, self.size(number))
        return Chunk(number, self.study.observers[observer], trials)

    def stretch(self, first: int, count: int) -> tuple[tuple[int, int], ...]:
        """List so many of an observer's trials from one on, in the order in which they are run."""
        order, worlds = self.study._order, self.study.worlds
        places = (divmod(place, worlds) for place in range(first, first + count))
        return tuple((int(order[at]), world) for at, world in places)

    def size(self, number: int) -> int:
        """Count the trials of a chunk."""
        return min(CHUNK, self._trials - number % self._per_observer * CHUNK)


@dataclass(frozen=True)
class SweepStudy:
    """A sweep.

    Attributes:
        scenario: The scenario that every trial starts from.
        axes: The varied fields.
        observers: The observers in the loop, and baselines: `zero`, `mems_gyro` and the like close no loop, so that
            their trials are those of a loop with the true rate.
        worlds: Trials a point and observer: world i has the same noise at every point, for every observer.
        design: `grid`: every combination of values. `sample`: a quasi-random design of the ranges and lists.
            `sobol`: one for Sobol indices.
        n: Points of the design; a design for indices has as many for each axis, and for two more.
        order: Observers, the best first, as someone expects them. The report counts how often the order holds; no
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
        """Check the study.

        Raises:
            InputError: A number, a name or a field does not fit.
        """
        check_axes(self.axes, self.design)
        check_worlds(self.worlds)
        check_points(self.design, self.n, len(self.axes))
        check_observers(self.observers)
        if self.order:
            check_order(self.order, self.observers)

    @cached_property
    def points(self) -> Points:
        """The values of the varied fields, a point each."""
        if self.design == "grid":
            return Points(self.axes)
        shares = sampled(len(self.axes), self.n, self.scenario.seed, indices=self.design == "sobol")
        return Points(self.axes, shares)

    @property
    def n_points(self) -> int:
        """Number of points, without drawing them."""
        if self.design == "grid":
            return math.prod(len(axis.values) for axis in self.axes)
        return self.n * (len(self.axes) + 2 if self.design == "sobol" else 1)

    @property
    def cells(self) -> int:
        """Points times observers."""
        return self.n_points * len(self.observers)

    @property
    def trials(self) -> int:
        """Number of runs."""
        return self.cells * self.worlds

    @cached_property
    def _order(self) -> np.ndarray:
        """Numbers of the points, those that can run in one batch next to each other, (n_points,)."""
        law = self.scenario.controller.kind
        apart = [field for axis in self.axes for field in axis.fields if not can_vary_in_batch(field, law)]
        if not apart:
            return np.arange(len(self.points))

        def unpooled(number: int) -> list[str]:
            point = self.points[number]
            return [repr(point[field]) for field in apart]

        return np.array(sorted(range(len(self.points)), key=unpooled))

    @property
    def baselines(self) -> tuple[str, ...]:
        """Names in `observers` that close no loop."""
        return tuple(name for name in self.observers if name in RATES)

    @property
    def references(self) -> tuple[str, ...]:
        """Baselines that observers are compared with; none where no observer is."""
        return self.baselines if len(self.baselines) < len(self.observers) else ()

    @property
    def contenders(self) -> list[int]:
        """Places in `observers` of those that are compared to find the best: baselines only among themselves."""
        closing = [place for place, name in enumerate(self.observers) if name not in RATES]
        return closing or list(range(len(self.observers)))

    def scenario_with(self, observer: str) -> Scenario:
        """Return the scenario with an observer in the loop; for a baseline with the true rate and measured angles.

        Raises:
            InputError: The law takes no rate, so that a baseline has no loop.
        """
        alone = self.scenario.model_copy(update={"open_loop_observers": []})
        if observer not in RATES:
            return alone.with_observer(observer)
        law = alone.controller.kind
        if not law_needs(LAW_CLASSES.find(law)):
            raise InputError(
                f"{observer}: a baseline's trials have the true rate in the loop, and controller.kind = {law!r} takes "
                f"none; leave {observer} out, or take another law"
            )
        by_truth = alone.with_observer(BASELINE_LOOP).as_fields()
        for name, value in BASELINE_SETTINGS.items():
            assign(by_truth, f"controller.{name}", value, observer)
        return parse_scenario(by_truth, f"the baseline {observer}")

    @property
    def chunks(self) -> Chunks:
        """All trials; those that can run in one batch are next to each other."""
        return Chunks(self)

    def as_fields(self, scenario: Mapping[str, FieldValue]) -> dict[str, dict[str, FieldValue]]:
        """Make the sections of a study file, with the scenario as given."""
        design: dict[str, FieldValue] = {
            "observers": list(self.observers),
            "worlds": self.worlds,
            "design": self.design,
        }
        if self.design != "grid":
            design["n"] = self.n
        if self.order:
            design["order"] = list(self.order)
        return {
            "sweep": design,
            "vary": {axis.option: axis.as_field() for axis in self.axes},
            "scenario": dict(scenario),
        }


def check_values(study: SweepStudy) -> None:
    """Check that every observer can run, and that every field takes each of its values by itself.

    An observer's field is tried with every observer. A value that is varied alone must fit the scenario, too.
    Values that do not fit each other are found when they are run, and cost their own trials alone.

    Raises:
        InputError: An observer cannot run, or a field or value does not fit.
    """
    plant = load_scenario_plant(study.scenario)
    base = study.scenario.model_copy(update={"open_loop_observers": []})
    for observer in study.observers:
        prepare(study.scenario_with(observer), plant)
    fields = base.as_fields()
    for axis in study.axes:
        parameters = {field.partition(".")[2] for field in axis.fields if field.startswith("observer.")}
        if parameters and study.baselines:
            raise InputError(f"--vary {axis.option}: a baseline has no parameters; leave {study.baselines[0]} out")
        values = axis.values or (axis.low, axis.high)
        for i, value in enumerate(values):
            changed = copy.deepcopy(fields)
            for field in axis.fields:
                assign(changed, field, value, f"--vary {field}")
            scenario = parse_scenario(changed, f"--vary {axis.option}={value}")
            if "plant.model" in axis.fields:
                find("models", str(value), ".xml", f"--vary {axis.option}: plant.model =")
            alone = len(study.axes) == 1 and (i < MOST_ALONE or i == len(values) - 1)
            changed_plant = load_scenario_plant(scenario, plant) if alone else plant
            for observer in study.observers if parameters else study.observers[: int(alone)]:
                settings = scenario.observer
                kind = BASELINE_LOOP if observer in RATES else observer
                if kind != base.observer.kind:
                    settings = ObserverSettings.model_validate({"kind": kind, **dict.fromkeys(parameters, value)})
                prepare(scenario.model_copy(update={"observer": settings}), changed_plant)


def counted(n: int, noun: str) -> str:
    """Put a number before a noun: `1 world`, `2 worlds`."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"
