"""The study of a sweep: a scenario, what is varied in it and how, the observers, the worlds; and its file."""

from __future__ import annotations

import math
import re
import tomllib
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from cmg_mj.core.errors import InputError, nearest, shown
from cmg_mj.core.types import law_needs
from cmg_mj.inputs.files import find, read_toml, whole_path
from cmg_mj.inputs.messages import complaints
from cmg_mj.inputs.overrides import assign, value_of
from cmg_mj.laws import LAW_CLASSES
from cmg_mj.observers import OBSERVERS
from cmg_mj.plant.plant import Plant, load_scenario_plant
from cmg_mj.results.baselines import NO_OBSERVERS
from cmg_mj.runs.batch import UNUSED, can_vary_in_batch
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.schema import Scenario, parse_scenario
from cmg_mj.scenario.time_grid import time_grid

# --- varied fields

Variation: TypeAlias = Any
"""Values of a field: a list or array of them, a single one, or text as `--vary` takes it."""

MAX_VALUES = 10_000
"""Values of one range."""
LOG = "log:"
TOGETHER = "+"
"""Between fields that take the same values."""
DIGITS = 12
"""Significant digits of a range's values: 0.3 is to be 0.3, in the table too."""


@dataclass(frozen=True)
class VariedField:
    """One varied field, or several that take the same values together.

    Attributes:
        fields: The fields, as with `--set`; the first names the axis in tables and pictures.
        values: The values of a list or of a range with a count; none for a range of which any value may be sampled.
        low: Lower end of a range to be sampled.
        high: Upper end of a range to be sampled.
        log: Whether the range is sampled evenly in its logarithm.
    """

    fields: tuple[str, ...]
    values: tuple[Any, ...] = ()
    low: float = math.nan
    high: float = math.nan
    log: bool = False

    @property
    def field(self) -> str:
        """The first field."""
        return self.fields[0]

    @property
    def option(self) -> str:
        """The fields as `--vary` takes them."""
        return TOGETHER.join(self.fields)

    def at(self, shares: np.ndarray) -> list[Any]:
        """Choose values at shares of the range between 0 and 1, (n,); of a list each value has an equal part."""
        if self.values:
            return [self.values[min(int(share * len(self.values)), len(self.values) - 1)] for share in shares]
        if self.log:
            values = np.exp(math.log(self.low) + shares * (math.log(self.high) - math.log(self.low)))
        else:
            values = self.low + shares * (self.high - self.low)
        return [float(f"{value:.{DIGITS}g}") for value in values]

    def as_field(self) -> Any:
        """Write the values as a study file has them: a list, or `low:high`."""
        return list(self.values) or f"{LOG if self.log else ''}{self.low!r}:{self.high!r}"


def parse_axis(option: str, variation: Variation, where: str) -> VariedField:
    """Read the values of a varied field.

    Args:
        option: The field; several that take the same values with `+` between.
        variation: A list of values, or a single one; or text: values with commas between, `first:last:count` for as
            many evenly spaced, `low:high` for a range to be sampled, each also with `log:` before it.
        where: The setting's name in an error.

    Returns:
        The axis.

    Raises:
        InputError: The field or its values are not written so.
    """
    fields = tuple(field.strip() for field in option.split(TOGETHER))
    if "" in fields:
        raise InputError(f"{where}: write FIELD=VALUES, for example plant.equilibrium_bias_deg=-1.5:1.5:13")
    values = _plain(variation)
    names = fields[0].endswith(".kind")  # module:Class is no range
    if isinstance(values, str) and ":" in values and not names and not values.lstrip().startswith(("[", '"')):
        return _parse_range(fields, values.strip(), where)
    if isinstance(values, str):
        values = _parse_list(values, where)
    if isinstance(values, (int, float)):
        values = [values]
    if isinstance(values, Mapping) or not isinstance(values, Iterable):
        raise InputError(f"{where}: {shown(values)}: must be a list of values, or text such as '-1:1:5'")
    values = [_plain(value) for value in values]
    if not values:
        raise InputError(f"{where}: no values; write FIELD=VALUES, such as plant.equilibrium_bias_deg=0,0.5")
    twice = next((value for i, value in enumerate(values) if value in values[:i]), None)
    if twice is not None:
        raise InputError(f"{where}: {twice} is there twice")
    return VariedField(fields, tuple(values))


def _parse_range(fields: tuple[str, ...], text: str, where: str) -> VariedField:
    log = text.startswith(LOG)
    try:
        first, last, *counts = text.removeprefix(LOG).split(":")
        low, high = float(first), float(last)
        (count,) = map(int, counts) if counts else (None,)
    except ValueError:
        raise InputError(
            f"{where}: {text!r} is no range; write first:last:count, or low:high for --sample, "
            "with log: before it for a logarithmic one"
        ) from None
    wrong = low == high or (count is None and low > high) or (log and min(low, high) <= 0.0)
    if wrong or not math.isfinite(high - low):
        raise InputError(f"{where}: its ends must be two different numbers, the lower one first, after log: above 0")
    axis = VariedField(fields, (), low, high, log)
    if count is None:
        return axis
    if not 2 <= count <= MAX_VALUES:
        raise InputError(f"{where}: {count} values; a range has at least 2, at most {MAX_VALUES}")
    return VariedField(fields, tuple(axis.at(np.linspace(0.0, 1.0, count))))


def _plain(value: Any) -> Any:
    """Make numpy's numbers and arrays Python's."""
    return value.tolist() if hasattr(value, "tolist") else value


def _parse_list(text: str, where: str) -> list[Any]:
    """Read values with commas between; a bare word is a string, as with `--set`."""
    try:
        return tomllib.loads(f"values = [{text}]")["values"]
    except (ValueError, RecursionError):
        words = [word.strip() for word in text.split(",")]
        if "" in words or any(mark in text for mark in "[]{}\"'="):
            raise InputError(f"{where}: {text!r} is no list; write values with commas between") from None
        return [value_of(word) for word in words]


# --- the study

Point = dict[str, Any]
"""Varied field -> its value."""
Trial = tuple[int, int]
"""Number of the point, world."""
WORLDS = 20
"""Worlds a cell by default."""
MAX_TRIALS = 1_000_000
"""Beyond it a sweep must be asked for twice (`--yes`)."""
CHUNK = 1024
"""Trials of a chunk: so many fill a batch, and take minutes at most."""
NOT_VARIED = {
    "seed": "worlds differ in it already: --worlds says how many, --seed which",
    "observer": "--observers names them",
    "observer.kind": "--observers names them",
    "open_loop_observers": "a sweep runs without them; --observers puts each in the loop",
}
"""Fields that a sweep does not vary, and why, besides those on which no trial depends."""
BASELINE_LOOP = "linear"
"""Observer that runs where a baseline's trials have the true rate in the loop; nothing depends on it."""
BASELINE_SETTINGS = {"feedback": "truth", "angle_source": "measured", "bias_trim_s": 0.0}
"""Fields of [controller] of a baseline's loop: with others the loop would depend on `BASELINE_LOOP`."""


@dataclass(frozen=True)
class SweepStudy:
    """A sweep.

    Attributes:
        scenario: The scenario that every trial starts from.
        axes: The varied fields.
        observers: The observers in the loop, and baselines: `zero`, `mems_gyro` and the like close no loop, so that
            their trials are those of a loop with the true rate.
        worlds: Trials a point and observer: world i has the same noise at every point, for every observer.
        sample: Points of a quasi-random design of the ranges and lists; None for every combination of values, of which
            the last field's change first.
    """

    scenario: Scenario
    axes: tuple[VariedField, ...]
    observers: tuple[str, ...]
    worlds: int
    sample: int | None = None

    def __post_init__(self) -> None:
        """Check the study, as far as is known without importing a user's observer.

        Raises:
            InputError: A number, a name or a field does not fit.
        """
        if not self.axes:
            raise InputError("--vary: nothing is varied; give a field, such as --vary plant.equilibrium_bias_deg=0,0.5")
        for field, times in Counter(self.fields).items():
            why = "no trial depends on it" if field.partition(".")[0] in UNUSED else "given twice" if times > 1 else ""
            if why := NOT_VARIED.get(field, why):
                raise InputError(f"--vary {field}: {why}")
        for axis in self.axes:
            if not axis.values and self.sample is None:
                raise InputError(
                    f"--vary {axis.field}: a range without a count is for --sample; write first:last:count"
                )
        for name, count in {"worlds": self.worlds, "--sample, n": self.sample}.items():
            if count is not None and not (isinstance(count, (int, np.integer)) and count >= 1):
                raise InputError(f"{name} = {count}: must be a whole number, 1 or more")
        for name, times in Counter(map(str, self.observers)).items():
            if ":" not in name and name not in (*OBSERVERS, *NO_OBSERVERS):
                known = nearest(name, [*OBSERVERS, *NO_OBSERVERS])
                raise InputError(f"observers: {name!r}: no such observer; {known}, or your own as package.module:Class")
            if times > 1:
                raise InputError(f"observers: {name!r} is there twice")
        if not self.observers:
            raise InputError("observers: there must be one at least")

    @property
    def fields(self) -> list[str]:
        """All varied fields."""
        return [field for axis in self.axes for field in axis.fields]

    @property
    def n_points(self) -> int:
        """Number of points, without drawing them."""
        return self.sample or math.prod(len(axis.values) for axis in self.axes)

    @property
    def trials(self) -> int:
        """Number of runs."""
        return self.n_points * len(self.observers) * self.worlds

    def trials_without(self, chunks: Sequence[int]) -> int:
        """Number of runs in all chunks but some."""
        return self.trials - sum(map(self.chunk_size, chunks))

    @cached_property
    def _drawn(self) -> list[list[Any]]:
        """The values of each axis at a design's points, (n_axes, n_points)."""
        shares = sampled(len(self.axes), self.n_points, self.scenario.seed)
        return [axis.at(share) for axis, share in zip(self.axes, shares.T, strict=True)]

    def point(self, number: int) -> Point:
        """Return the values of the varied fields at a point."""
        if self.sample is None:
            places = np.unravel_index(number, [len(axis.values) for axis in self.axes])
            row = [axis.values[place] for axis, place in zip(self.axes, places, strict=True)]
        else:
            row = [values[number] for values in self._drawn]
        return {field: value for axis, value in zip(self.axes, row, strict=True) for field in axis.fields}

    @property
    def apart(self) -> list[str]:
        """Varied fields whose values cannot run in one batch."""
        return [field for field in self.fields if not can_vary_in_batch(field, self.scenario.controller.kind)]

    @cached_property
    def _order(self) -> np.ndarray:
        """Numbers of the points, those that can run in one batch next to each other, (n_points,)."""
        if not self.apart:
            return np.arange(self.n_points)
        values = itemgetter(*self.apart)
        return np.array(sorted(range(self.n_points), key=lambda number: repr(values(self.point(number)))))

    @property
    def _chunks_an_observer(self) -> int:
        return -(-self.n_points * self.worlds // CHUNK)

    @property
    def n_chunks(self) -> int:
        """Number of chunks."""
        return self._chunks_an_observer * len(self.observers)

    def chunk_size(self, number: int) -> int:
        """Count the trials of a chunk."""
        return min(CHUNK, self.n_points * self.worlds - number % self._chunks_an_observer * CHUNK)

    def chunk(self, number: int) -> tuple[str, list[Trial]]:
        """Return the observer and the trials of a chunk."""
        observer, piece = divmod(number, self._chunks_an_observer)
        return self.observers[observer], self.stretch(piece * CHUNK, self.chunk_size(number))

    def stretch(self, first: int, count: int) -> list[Trial]:
        """List so many of an observer's trials from one on; those that can run in one batch are next to each other."""
        places = (divmod(place, self.worlds) for place in range(first, first + count))
        return [(int(self._order[at]), world) for at, world in places]

    @property
    def baselines(self) -> tuple[str, ...]:
        """Names in `observers` that close no loop."""
        return tuple(name for name in self.observers if name in NO_OBSERVERS)

    @property
    def references(self) -> tuple[str, ...]:
        """Baselines that observers are compared with; none where no observer is."""
        return self.baselines if len(self.baselines) < len(self.observers) else ()

    @property
    def contenders(self) -> list[int]:
        """Places in `observers` of those that are compared to find the best: baselines only among themselves."""
        closing = [place for place, name in enumerate(self.observers) if name not in NO_OBSERVERS]
        return closing or list(range(len(self.observers)))

    def scenario_with(self, observer: str) -> Scenario:
        """Return the scenario with an observer in the loop; for a baseline with the true rate and measured angles.

        Raises:
            InputError: The law takes no rate, so that a baseline has no loop.
        """
        alone = self.scenario.model_copy(update={"open_loop_observers": []})
        if observer not in NO_OBSERVERS:
            return alone.with_observer(observer)
        law = alone.controller.kind
        if not law_needs(LAW_CLASSES.find(law)):
            raise InputError(
                f"{observer}: a baseline's trials have the true rate in the loop, and controller.kind = {law!r} takes "
                f"none; leave {observer} out, or take another law"
            )
        by_truth = alone.with_observer(BASELINE_LOOP).as_fields()
        by_truth["controller"] |= BASELINE_SETTINGS
        return parse_scenario(by_truth, f"the baseline {observer}")

    def as_fields(self, scenario: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
        """Make the sections of a study file, with the scenario as given."""
        design = {"design": "grid"} if self.sample is None else {"design": "sample", "n": self.sample}
        return {
            "sweep": {"observers": list(self.observers), "worlds": self.worlds, **design},
            "vary": {axis.option: axis.as_field() for axis in self.axes},
            "scenario": dict(scenario),
        }


def sampled(dimensions: int, n: int, seed: int) -> np.ndarray:
    """Spread points evenly in the unit cube, (n, dimensions)."""
    from scipy.stats import qmc  # half a second

    # The argument is called `rng` since 1.15; all versions take this name.
    generator: Any = {"seed": np.random.default_rng(seed)}
    with warnings.catch_warnings(action="ignore"):  # that n is no power of two
        return qmc.Sobol(dimensions, **generator).random(n)


def check_values(study: SweepStudy) -> None:
    """Check that every observer can run, and that every field takes each of its values by itself.

    An observer's field is tried with every observer. A value that is varied alone must fit the scenario, too.
    Values that do not fit each other are found when they are run, and cost their own trials alone.

    Raises:
        InputError: An observer cannot run, or a field or value does not fit.
    """
    plant = _plant(study.scenario)
    bases = [study.scenario_with(observer) for observer in study.observers]
    for base in bases:
        prepare(base, plant)
    alone = len(study.axes) == 1  # a value takes 5 ms
    for axis in study.axes:
        of_observer = any(field.startswith("observer.") for field in axis.fields)
        if of_observer and study.baselines:
            raise InputError(f"--vary {axis.option}: a baseline has no parameters; leave {study.baselines[0]} out")
        for value in axis.values or (axis.low, axis.high):
            if "plant.model" in axis.fields:
                find("models", str(value), ".xml", f"--vary {axis.option}: plant.model =")
            for base in bases if of_observer else bases[:1]:
                fields = base.as_fields()
                for field in axis.fields:
                    assign(fields, field, value, f"--vary {field}")
                scenario = parse_scenario(fields, f"--vary {axis.option}={value}")
                if alone or of_observer:
                    prepare(scenario, _plant(scenario, plant) if alone else plant)


def _plant(scenario: Scenario, like: Plant | None = None) -> Plant:
    """Load the plant of a scenario that may be wrong."""
    with scenario.named_in_errors():
        return load_scenario_plant(scenario, time_grid(scenario), like)


# --- its file


class SweepSection(BaseModel):
    """The section [sweep] of a study file."""

    model_config = ConfigDict(extra="forbid", strict=True)
    observers: list[str] | None = None
    worlds: int = WORLDS
    design: Literal["grid", "sample"] | None = None
    n: int | None = None

    @property
    def points(self) -> int | None:
        """Points of a quasi-random design; None for a grid."""
        if self.design == "sample":
            return self.n or 0
        if self.n:
            raise InputError(f"n = {self.n}: is for the design sample; a grid is every combination")
        return None


class StudyFile(BaseModel):
    """The sections of a study file; [scenario] is a table or a scenario's name."""

    model_config = ConfigDict(extra="forbid", strict=True)
    sweep: SweepSection = SweepSection()
    vary: dict[str, Any] = {}
    scenario: str | dict[str, Any]


def read_study(name: str) -> StudyFile:
    """Read a study file; a scenario's is one without a section [sweep].

    Raises:
        InputError: Its sections are not written so.
    """
    path = find("scenarios", name, ".toml", "scenario")
    try:
        fields = read_toml(path, name)
    except InputError:
        fields = {}  # as a scenario it is refused with what is wrong
    if "vary" not in fields and "sweep" not in fields:
        fields = {"scenario": name}
    try:
        return StudyFile.model_validate(fields)
    except ValidationError as error:
        raise InputError(f"{name}: {'; '.join(complaints(StudyFile, error.errors(), fields))}") from error


MAY_NAME_TRACKS = re.compile(r"pivot(\.\d+(\.file)?)?")


def locate_tracks(axis: VariedField, beside: Path) -> VariedField:
    """Give the tracks that an axis varies whole paths, which may start from the folder of the study or scenario."""
    return _change_tracks(axis, lambda file: whole_path(file, beside))


def varied_tracks(axis: VariedField) -> list[str]:
    """List the tracks that an axis varies."""
    files: list[str] = []

    _change_tracks(axis, files.append)  # the changed axis is not needed
    return files


def _change_tracks(axis: VariedField, change: Callable[[str], str | None]) -> VariedField:
    def changed(value: Any) -> Any:
        """Change the paths in a value: of a file, of a motion, or of all motions."""
        if isinstance(value, str):
            return change(value)
        if isinstance(value, Mapping):
            return {**value, "file": changed(value["file"])} if "file" in value else value
        return [changed(motion) for motion in value] if isinstance(value, Sequence) else value

    if any(MAY_NAME_TRACKS.fullmatch(field) for field in axis.fields):
        return replace(axis, values=tuple(map(changed, axis.values)))
    return axis
