"""The study of a sweep: a scenario, what is varied in it and how, the observers, the worlds; and its file."""

from __future__ import annotations

import copy
import math
import re
import tomllib
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias, TypedDict, TypeGuard, get_args, runtime_checkable

import numpy as np

from cmg_mj.core.errors import InputError, TomlValue, nearest, shown
from cmg_mj.core.types import law_needs
from cmg_mj.inputs.files import bundled, find
from cmg_mj.inputs.overrides import assign, override
from cmg_mj.laws import LAW_CLASSES
from cmg_mj.observers import OBSERVERS
from cmg_mj.plant.build import load_scenario_plant
from cmg_mj.results.baselines import RATES
from cmg_mj.runs.batch import UNUSED, can_vary_in_batch
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import find_model, find_track, find_tracks, load_scenario
from cmg_mj.scenario.schema import ObserverSettings, Scenario, parse_scenario

# --- varied fields

FieldValue: TypeAlias = "float | str | Sequence[FieldValue] | Mapping[str, FieldValue]"
"""A value of a scenario's field, as TOML has it."""


@runtime_checkable
class Array(Protocol):
    """Numbers of numpy, pandas or the like."""

    def tolist(self) -> FieldValue:
        """Make plain numbers."""
        ...


Variation: TypeAlias = "FieldValue | Array"
"""Values of a field: a list of them, a single one, or text as `--vary` takes it."""

MOST_VALUES = 10_000
"""Values of one field."""
LOG = "log:"
TOGETHER = "+"
"""Between fields that take the same values."""
DIGITS = 12
"""Significant digits of a range's values: 0.3 is to be 0.3, in the table too."""


@dataclass(frozen=True)
class VariedField:
    """One varied field, or several that take the same values together.

    Attributes:
        field: The field, as with `--set`; of several the first, which names the axis in tables and pictures.
        values: The values of a list or of a range with a count; none for a range of which any value may be sampled.
        low: Lower end of a range to be sampled.
        high: Upper end of a range to be sampled.
        log: Whether the range is sampled evenly in its logarithm.
        also: Fields that take the same value at every point.
    """

    field: str
    values: tuple[FieldValue, ...] = ()
    low: float = math.nan
    high: float = math.nan
    log: bool = False
    also: tuple[str, ...] = ()

    @property
    def fields(self) -> tuple[str, ...]:
        """All fields that take the value."""
        return (self.field, *self.also)

    @property
    def option(self) -> str:
        """The fields as `--vary` takes them."""
        return TOGETHER.join(self.fields)

    @property
    def is_range(self) -> bool:
        """Return whether the values are a range to be sampled."""
        return not self.values

    def at(self, shares: np.ndarray) -> list[FieldValue]:
        """Choose values at shares of the range between 0 and 1, (n,); of a list each value has an equal part."""
        if not self.is_range:
            return [self.values[min(int(share * len(self.values)), len(self.values) - 1)] for share in shares]
        if self.log:
            values = np.exp(math.log(self.low) + shares * (math.log(self.high) - math.log(self.low)))
        else:
            values = self.low + shares * (self.high - self.low)
        return [float(f"{value:.{DIGITS}g}") for value in values]

    def as_field(self) -> FieldValue:
        """Write the values as a study file has them: a list, or `low:high`."""
        return list(self.values) if self.values else f"{LOG if self.log else ''}{self.low!r}:{self.high!r}"


def parse_axis(field: str, variation: Variation, where: str) -> VariedField:
    """Read the values of a varied field.

    Args:
        field: The field; several that take the same values with `+` between.
        variation: A list of values, or a single one; or text: values with commas between, `first:last:count` for as
            many evenly spaced, `low:high` for a range to be sampled, each also with `log:` before it.
        where: The setting's name in an error.

    Returns:
        The axis.

    Raises:
        InputError: The field or its values are not written so.
    """
    field, *also = (part.strip() for part in field.split(TOGETHER))
    if not field or "" in also:
        raise InputError(f"{where}: write FIELD=VALUES, for example plant.equilibrium_bias_deg=-1.5:1.5:13")
    if isinstance(variation, str) and ":" in variation and not variation.lstrip().startswith(("[", '"')):
        return replace(_parse_range(field, variation.strip(), where), also=tuple(also))
    values = _parse_list(variation, where) if isinstance(variation, str) else _as_list(variation, where)
    if not values:
        raise InputError(f"{where}: no values; write FIELD=VALUES, such as plant.equilibrium_bias_deg=0,0.5")
    if len(values) > MOST_VALUES:
        raise InputError(f"{where}: {len(values)} values; at most {MOST_VALUES}")
    twice = next((value for i, value in enumerate(values) if value in values[:i]), None)
    if twice is not None:
        raise InputError(f"{where}: {twice} is there twice")
    return VariedField(field, tuple(values), also=tuple(also))


def _parse_range(field: str, text: str, where: str) -> VariedField:
    log = text.startswith(LOG)
    try:
        first, last, *counts = text.removeprefix(LOG).split(":")
        low, high = float(first), float(last)
        (count,) = map(int, counts) if counts else (None,)
    except ValueError:
        raise InputError(
            f"{where}: {text!r} is no range; write first:last:count, or low:high for --sample and --sobol, "
            "with log: before it for a logarithmic one"
        ) from None
    if not math.isfinite(high - low) or low == high or (count is None and low > high):
        raise InputError(f"{where}: an empty range; its ends must be two different numbers, the lower one first")
    if log and min(low, high) <= 0.0:
        raise InputError(f"{where}: a logarithmic range needs ends above 0")
    axis = VariedField(field, (), low, high, log)
    if count is None:
        return axis
    if not 2 <= count <= MOST_VALUES:
        raise InputError(f"{where}: {count} values; a range has at least 2, at most {MOST_VALUES}")
    return VariedField(field, tuple(axis.at(np.linspace(0.0, 1.0, count))))


def _as_list(variation: Variation, where: str) -> list[FieldValue]:
    """Make values that are no text into a list, with numpy's numbers as Python's."""
    values = variation.tolist() if isinstance(variation, Array) else variation
    if isinstance(values, (bool, int, float)):
        return [values]
    if isinstance(values, Mapping) or not isinstance(values, Iterable):
        raise InputError(f"{where}: {shown(values)}: must be a list of values, or text such as '-1:1:5'")
    return [value.tolist() if isinstance(value, Array) else value for value in values]


def _parse_list(text: str, where: str) -> list[FieldValue]:
    """Read values with commas between; a bare word is a string, as with `--set`."""
    try:
        return tomllib.loads(f"values = [{text}]")["values"]
    except (ValueError, RecursionError):
        words = [word.strip() for word in text.split(",")]
        if "" in words or any(mark in text for mark in "[]{}\"'="):
            raise InputError(f"{where}: {text!r} is no list; write values with commas between") from None
        return [_word(word) for word in words]


def _word(word: str) -> FieldValue:
    try:
        return tomllib.loads(f"value = {word}")["value"]
    except ValueError:
        return word


def is_number(value: FieldValue) -> TypeGuard[float]:
    """Tell a number from a truth value, a text and a list."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


# --- points

Point = dict[str, FieldValue]
"""Varied field -> its value."""


class Points:
    """Points by their numbers, each made when it is asked for.

    Args:
        axes: The varied fields.
        shares: The place of a design's points in the axes' ranges, (n_points, n_axes); None for a grid: every
            combination of values, of which the last field's change first.
    """

    def __init__(self, axes: Sequence[VariedField], shares: np.ndarray | None = None) -> None:
        self._fields = [axis.fields for axis in axes]
        self._values: list[Sequence[FieldValue]] = [axis.values for axis in axes]
        self._is_grid = shares is None
        if shares is not None:
            self._values = [axis.at(share) for axis, share in zip(axes, shares.T, strict=True)]

    def __len__(self) -> int:
        return math.prod(map(len, self._values)) if self._is_grid else len(self._values[0])

    def __iter__(self) -> Iterator[Point]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, number: int) -> Point:
        if not 0 <= number < len(self):
            raise IndexError(number)
        row: list[FieldValue] = []
        for values in reversed(self._values):
            row.insert(0, values[number % len(values)])
            if self._is_grid:
                number //= len(values)
        return {field: value for fields, value in zip(self._fields, row, strict=True) for field in fields}


def sampled(dimensions: int, n: int, seed: int, *, indices: bool) -> np.ndarray:
    """Spread points evenly in the unit cube, (n_points, dimensions).

    For indices the points are those of Saltelli's scheme, as `scipy.stats.sobol_indices` wants them: A, B, then A with
    each column in turn from B.
    """
    from scipy.stats import qmc  # half a second

    # The argument is called `rng` since 1.15; all versions take this name.
    generator: Any = {"seed": np.random.default_rng(seed)}
    with warnings.catch_warnings():  # that n is no power of two
        warnings.simplefilter("ignore", UserWarning)
        drawn = qmc.Sobol(2 * dimensions if indices else dimensions, **generator).random(n)
    if not indices:
        return drawn
    a, b = drawn[:, :dimensions], drawn[:, dimensions:]
    crossed = [np.where(np.arange(dimensions) == i, b, a) for i in range(dimensions)]
    return np.concatenate([a, b, *crossed])


# --- checks

NOT_VARIED = {
    "seed": "worlds differ in it already: --worlds says how many, --seed which",
    "observer": "--observers names them",
    "observer.kind": "--observers names them",
    "open_loop_observers": "a sweep runs without them; --observers puts each in the loop",
    **dict.fromkeys(sorted(UNUSED), "no trial depends on it"),
}
"""Fields that a sweep does not vary, and why. Fields below them are not varied either, but for an observer's own."""


def check_axes(axes: Sequence[VariedField], design: str) -> None:
    """Check that something is varied, each field once, so that it makes a difference, and that a range is sampled."""
    if not axes:
        raise InputError("--vary: nothing is varied; give a field, such as --vary plant.equilibrium_bias_deg=0,0.5")
    fields = [field for axis in axes for field in axis.fields]
    for i, field in enumerate(fields):
        if field in fields[:i]:
            raise InputError(f"--vary {field}: given twice")
        section = field.partition(".")[0]
        why = NOT_VARIED.get(field) or (None if section == "observer" else NOT_VARIED.get(section))
        if why is not None:
            raise InputError(f"--vary {field}: is not varied: {why}")
    for axis in axes:
        if axis.is_range and design == "grid":
            raise InputError(
                f"--vary {axis.field}: a range without a count is for --sample and --sobol; write first:last:count"
            )


def check_points(design: str, n: int, axes: int) -> None:
    """Check a design's number of points: for indices as many as Saltelli's scheme wants, none for a grid."""
    if design == "grid" and n != 0:
        raise InputError(f"n = {shown(n)}: is for the designs sample and sobol; a grid is every combination")
    if design == "sample" and not _counts(n):
        raise InputError(f"--sample, n = {shown(n)}: must be a whole number of points, 1 or more")
    if design == "sobol" and (not _counts(n) or n < 2 or n & (n - 1)):
        raise InputError(f"--sobol {shown(n)}: must be a power of two, such as 256")
    if design == "sobol" and axes < 2:
        raise InputError(
            "--sobol: indices compare several fields; vary two or more (fields with + between count as one)"
        )


def check_observers(observers: Sequence[str]) -> None:
    """Check that observers exist, as far as is known without importing them, and are there once."""
    if not observers:
        raise InputError("observers: there must be one at least")
    for i, name in enumerate(observers):
        if not isinstance(name, str):
            raise InputError(f"observers: {shown(name)}: must be an observer's name")
        if ":" not in name and name not in (*OBSERVERS, *RATES):
            known = nearest(name, [*OBSERVERS, *RATES])
            raise InputError(f"observers: {name!r}: no such observer; {known}, or your own as package.module:Class")
        if name in observers[:i]:
            raise InputError(f"observers: {name!r} is there twice")


def _counts(number: float | str | None) -> bool:
    return isinstance(number, (int, np.integer)) and not isinstance(number, bool) and number >= 1


# --- the study

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
    """

    scenario: Scenario
    axes: tuple[VariedField, ...]
    observers: tuple[str, ...]
    worlds: int
    design: SamplingDesign = "grid"
    n: int = 0

    def __post_init__(self) -> None:
        """Check the study.

        Raises:
            InputError: A number, a name or a field does not fit.
        """
        check_axes(self.axes, self.design)
        if not _counts(self.worlds):
            raise InputError(f"worlds = {shown(self.worlds)}: must be a whole number, 1 or more")
        check_points(self.design, self.n, len(self.axes))
        check_observers(self.observers)

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


SECTIONS = ("sweep", "vary", "scenario")
SWEEP_TYPES = {"observers": list, "worlds": int, "design": str, "n": int}
"""Types of the fields of [sweep]."""


class SweepFields(TypedDict, total=False):
    """The fields of [sweep]."""

    observers: list[str]
    worlds: int
    design: str
    n: int


class StudyFile(TypedDict, total=False):
    """The sections of a study file."""

    sweep: SweepFields
    vary: dict[str, FieldValue]
    scenario: str | dict[str, TomlValue]


def study_file(name: str) -> StudyFile | None:
    """Read a study file; None of a scenario.

    Raises:
        InputError: The file is neither.
    """
    path = find("scenarios", name, ".toml", "scenario")
    if path.stem in bundled("scenarios"):
        return None
    try:
        fields = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return None  # as a scenario it is refused with what is wrong
    if "vary" not in fields and "sweep" not in fields:
        return None
    for section in fields:
        if section not in SECTIONS:
            raise InputError(f"{name}: {section}: no section of a study file; {nearest(section, SECTIONS)}")
    for section in ("vary", "sweep"):
        if not isinstance(fields.get(section, {}), dict):
            raise InputError(f"{name}: {section}: must be a table")
    for key, value in fields.get("sweep", {}).items():
        if key not in SWEEP_TYPES:
            raise InputError(f"{name}: sweep.{key}: no such field; {nearest(key, SWEEP_TYPES)}")
        if type(value) is not SWEEP_TYPES[key]:
            raise InputError(f"{name}: sweep.{key} = {value!r}: must be of type {SWEEP_TYPES[key].__name__}")
    return StudyFile(**fields)


def scenario_of(name: str, fields: StudyFile, settings: Sequence[str] = ()) -> Scenario:
    """Load a study file's scenario, a table or a name, with settings `section.field=value` that replace its own."""
    scenario_fields = fields.get("scenario")
    if isinstance(scenario_fields, str):
        return load_scenario(scenario_fields, settings)
    if not isinstance(scenario_fields, dict):
        raise InputError(f"{name}: scenario: must be there, as a table or as a scenario's name")
    changed = copy.deepcopy({key: value for key, value in scenario_fields.items() if key != "versions"})
    for setting in settings:
        override(changed, setting)
    where = " ".join([name, *(["with"] if settings else []), *(f"--set {setting}" for setting in settings)])
    scenario = parse_scenario(changed, where)
    beside = find("scenarios", name, ".toml", "scenario").parent
    if not any(setting.partition("=")[0].strip() == "plant.model" for setting in settings):
        scenario = find_model(scenario, beside)
    return find_tracks(scenario, beside)


def axes_of(name: str, fields: StudyFile) -> list[VariedField]:
    """Read a study file's [vary]."""
    return [parse_axis(field, value, f"{name}: vary.{field}") for field, value in fields.get("vary", {}).items()]


def design_of(name: str, fields: SweepFields) -> tuple[SamplingDesign, int]:
    """Read a study file's design, and how many points it has."""
    text = fields.get("design", "grid")
    designs: tuple[SamplingDesign, ...] = get_args(SamplingDesign)
    for design in designs:
        if text == design:
            return design, fields.get("n", 0)
    raise InputError(f"{name}: sweep.design = {text!r}: must be one of {', '.join(designs)}")


FILE = re.compile(r"pivot\.\d+\.file")
PIVOT = re.compile(r"pivot(\.\d+)?")


def locate_tracks(axis: VariedField, beside: Path) -> VariedField:
    """Give the tracks that an axis varies whole paths.

    Args:
        axis: The axis; of other fields it stays.
        beside: The folder of the study file or of the scenario, from which a path may start.
    """
    for field in axis.fields:
        change = partial(_replace_tracks, field, change=lambda file: find_track(file, beside))
        axis = replace(axis, values=tuple(change(value) for value in axis.values))
    return axis


def varied_tracks(axis: VariedField) -> list[str]:
    """List the tracks that an axis varies."""
    files: list[str] = []
    for field in axis.fields:
        for value in axis.values:
            _replace_tracks(field, value, change=lambda file: files.append(file) or file)
    return files


def _replace_tracks(field: str, value: FieldValue, change: Callable[[str], str]) -> FieldValue:
    """Change the paths of tracks in a value: of a file, of a motion, or of all motions."""
    if FILE.fullmatch(field):
        return change(str(value))
    if not PIVOT.fullmatch(field) or isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        file = value.get("file")
        return {**value, "file": change(file)} if isinstance(file, str) else value
    if isinstance(value, Sequence):
        return [_replace_tracks(field, motion, change) for motion in value]
    return value
