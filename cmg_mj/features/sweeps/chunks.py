"""The chunks of a sweep: a row a trial, computed here, kept on disk a Parquet file each, and their cost."""

from __future__ import annotations

import hashlib
import json
import os
import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from cmg_mj.core.errors import InputError, RunStopped, raised
from cmg_mj.features.sweeps.study import CHUNK, MOST_TRIALS, Chunk, FieldValue, Point, Points, SweepStudy, varied_tracks
from cmg_mj.inputs.files import find, model_files
from cmg_mj.results.files import whole_file
from cmg_mj.results.folder import is_own, numbered, remove, write_marker
from cmg_mj.results.summary_keys import ID_COLUMNS, KEYS, Summary, SummaryValue
from cmg_mj.runs.batch import BatchKey, PlantStructure, can_vary_in_batch, plant_structure
from cmg_mj.runs.experiment import Experiment, prepare, run_batch

if TYPE_CHECKING:
    from cmg_mj.results.result import Result


COLUMNS = [name for name in ID_COLUMNS if name != "in_loop_of"]
"""Columns of a trial, after what is varied and before its figures."""
REFUSED = "refused"
"""Outcome of a trial whose values do not fit each other: it never begins."""

BatchId = tuple[BatchKey, PlantStructure]
"""Properties that the worlds of one batch have in common."""


def compute(
    study: SweepStudy,
    chunk: Chunk,
    on_progress: Callable[[float], None] | None = None,
    *,
    points: Points | Mapping[int, Point] | None = None,
    threads: int = 0,
) -> list[Summary]:
    """Run the trials of a chunk.

    A trial that fails is a row with the reason: values that do not fit, physics that fails, an observer that raises.

    Args:
        study: The sweep.
        chunk: The trials.
        on_progress: Called after every tick with the share of the chunk that is done.
        points: The chunk's points by their numbers; by default they are made from the study.
        threads: Number of threads that step the worlds; 0: as many as there are processors.

    Returns:
        A row a trial, in the chunk's order: the point's number, the varied values, and the figures of the run.
    """
    points = study.points if points is None else points
    base = prepare(study.scenario_with(chunk.observer))
    baseline = chunk.observer if chunk.observer in study.baselines else None
    results: dict[tuple[int, int], Summary] = {}
    experiments: dict[int, Experiment] = {}
    batch_of: dict[int, BatchId] = {}
    refused: dict[int, str] = {}
    for number in dict.fromkeys(number for number, _ in chunk.trials):
        try:
            experiments[number] = base.with_settings(points[number])
            batch_of[number] = experiments[number].batch_key, plant_structure(experiments[number].plant)
        except InputError as error:
            refused[number] = str(error)
    batches: dict[BatchId, list[tuple[int, int]]] = {}
    for trial in chunk.trials:
        if trial[0] in refused:
            results[trial] = _unfinished(REFUSED, refused[trial[0]])
        else:
            batches.setdefault(batch_of[trial[0]], []).append(trial)
    done = len(results) / len(chunk.trials)
    for trials in batches.values():
        share = len(trials) / len(chunk.trials)
        tick = part_of_progress(on_progress, done, share / study.scenario.duration_s)
        rows = _run(
            [experiments[number] for number, _ in trials], [world for _, world in trials], tick, threads, baseline
        )
        results |= zip(trials, rows, strict=True)
        done += share
    return _with_identity(study, chunk, points, results)


def rows_of_failed_chunk(study: SweepStudy, chunk: Chunk, reason: str) -> list[Summary]:
    """Make the rows of a chunk that could not be computed: the reason in each."""
    return _with_identity(study, chunk, study.points, dict.fromkeys(chunk.trials, _unfinished("stopped", reason)))


def _with_identity(
    study: SweepStudy, chunk: Chunk, points: Points | Mapping[int, Point], results: Mapping[tuple[int, int], Summary]
) -> list[Summary]:
    """Put the point, the observer, the world and the seed before each trial's result."""
    of_all = {"observer": chunk.observer, "seed": study.scenario.seed}
    return [
        {"point": number, **_as_columns(points[number]), **of_all, "world": world, **results[number, world]}
        for number, world in chunk.trials
    ]


def part_of_progress(
    on_progress: Callable[[float], None] | None, start: float, size: float
) -> Callable[[float], None] | None:
    """Make the report of a part of a progress, which begins at the start and adds the size; None without a progress."""
    return on_progress and (lambda share: on_progress(start + size * share))


def _run(
    experiments: Sequence[Experiment],
    worlds: Sequence[int],
    tick: Callable[[float], None] | None,
    threads: int,
    baseline: str | None,
) -> list[Summary]:
    """Run trials in one batch. Where one raises, those that it stopped run again in halves, without it at last.

    Each trial is through or has raised by itself, so that no row depends on another's.
    """
    rows = dict(enumerate(_run_once(experiments, worlds, tick, threads, baseline)))
    again = [i for i, row in rows.items() if row is None]
    half = (len(again) + 1) // 2
    for part in filter(None, (again[:half], again[half:])):
        part_rows = _run([experiments[i] for i in part], [worlds[i] for i in part], tick, threads, baseline)
        rows |= zip(part, part_rows, strict=True)
    return [row for row in rows.values() if row is not None]


def _run_once(
    experiments: Sequence[Experiment],
    worlds: Sequence[int],
    tick: Callable[[float], None] | None,
    threads: int,
    baseline: str | None,
) -> list[Summary | None]:
    """Run one batch once; None for a trial that may have been stopped by another one."""
    try:
        result: Result = run_batch(experiments, worlds, keep_trajectory=False, on_progress=tick, threads=threads)
    except Exception as error:  # a user's observer may fail in any way
        alone = len(worlds) == 1
        return [_unfinished("stopped", raised(error)) if alone else None for _ in worlds]
    if any(outcome.kind == "interrupted" for outcome in result.outcomes):
        raise KeyboardInterrupt
    identity = {"observer", "in_loop_of", "world", "seed"}
    return [
        None if outcome.with_others else {key: value for key, value in row.items() if key not in identity}
        for outcome, row in zip(result.outcomes, result.rows(baseline), strict=True)
    ]


def _unfinished(outcome: str, reason: str) -> Summary:
    return {"outcome": outcome, "stood": False, "end_time_s": 0.0, "reason": reason}


def _as_columns(point: Point) -> Point:
    """Make a point's values into what a table can hold: a list becomes its text."""
    return {
        field: value if isinstance(value, (int, float, str, bool)) else repr(value) for field, value in point.items()
    }


FIGURES = [*(key for key in KEYS if key not in ("fell_fraction", "stopped_fraction")), "bias_deg"]
"""Figures of one trial."""


def schema_of(study: SweepStudy) -> pa.Schema:
    """Declare the columns: the point's number, what is varied, observer, world and outcome, the figures."""
    known = [(name, ID_COLUMNS[name]) for name in COLUMNS]
    return pa.schema([*point_columns(study), *known, *((name, "float64") for name in FIGURES)])


def point_columns(study: SweepStudy) -> list[tuple[str, str]]:
    """Declare the first columns of every table of a sweep: the point's number, what is varied."""
    types = [_type_of([axis.low] if axis.is_range else axis.values) for axis in study.axes]
    return [
        ("point", "int64"),
        *((field, kind) for axis, kind in zip(study.axes, types, strict=True) for field in axis.fields),
    ]


def _type_of(values: Sequence[SummaryValue]) -> str:
    if all(isinstance(value, bool) for value in values):
        return "bool"
    if all(type(value) is int and -(2**63) <= value < 2**63 for value in values):
        return "int64"
    if all(type(value) in (int, float) for value in values):
        return "float64"
    return "string"


def table_of(study: SweepStudy, rows: Iterable[Mapping[str, SummaryValue]]) -> pa.Table:
    """Make rows of trials into a table; a figure that a trial does not have is null."""
    return as_table(rows, schema_of(study))


def as_table(rows: Iterable[Mapping[str, SummaryValue]], schema: pa.Schema) -> pa.Table:
    """Make rows into a table; what a row does not have is null, and a value that no column can hold is its text."""
    cells = list(rows)

    def column(name: str) -> list[SummaryValue]:
        kind, values = str(schema.field(name).type), [row.get(name) for row in cells]
        if kind == "string":
            return [value if value is None or isinstance(value, str) else repr(value) for value in values]
        if kind == "double":  # Arrow takes no whole number beyond 2**53 for a double
            return [float(value) if isinstance(value, int) else value for value in values]
        return values

    return pa.table({name: column(name) for name in schema.names}, schema=schema)


TRIALS_TIMED, SECONDS, STRETCHES = 256, 1.5, 8
"""Trials that stand for a chunk, how long they run once they have begun [s], and in how many places."""
POINTS = 4096
"""Points that stand for all of a study beyond `MOST_TRIALS`."""
MB_AT_LEAST, MB_A_WORLD, MB_A_WORLD_S, MB_A_POINT, BYTES_A_TRIAL = 230.0, 0.015, 0.008, 0.12, 200.0
"""Memory of the process with its pictures; of a chunk's trials, their seconds, and its points; of every trial.

By the peaks (VmHWM) of four sweeps on Linux: of 0.05 s, 2 points x 50 worlds, 1,000 x 100, 5,000 x 1: 232, 252 and
372 MB; of 15 s, 1 x 1,024: 365 MB.
"""


def estimate_cost(study: SweepStudy) -> dict[str, float]:
    """Estimate minutes on this machine and memory, as far as a piece of every observer can say.

    Returns:
        The figures that `--dry-run --json` prints.
    """
    thinned = _thinned(study)
    seconds = sum(_seconds_a_trial(thinned, observer) for observer in study.observers)
    trials_an_observer = study.n_points * study.worlds
    trials_a_chunk = min(CHUNK, trials_an_observer)
    plants = min(study.n_points, -(-trials_a_chunk // study.worlds))
    return {
        "points": study.n_points,
        "observers": len(study.observers),
        "worlds": study.worlds,
        "trials": study.trials,
        "chunks": study.chunks.count,
        "minutes": seconds * trials_an_observer / 60.0,
        "memory_mb": MB_AT_LEAST
        + (MB_A_WORLD + MB_A_WORLD_S * study.scenario.duration_s) * trials_a_chunk
        + MB_A_POINT * plants
        + BYTES_A_TRIAL * study.trials / 2**20,
    }


def _thinned(study: SweepStudy) -> SweepStudy:
    """Thin a very large study, whose points would take long to draw and much memory, to points that lie alike."""
    if study.trials <= MOST_TRIALS or study.n_points <= POINTS:
        return study
    return replace(study, design="sample", n=POINTS)


def _seconds_a_trial(study: SweepStudy, observer: str) -> float:
    """Time some of an observer's trials, in several stretches if not all can run in one batch [s]."""
    trials = study.n_points * study.worlds
    pooled = all(
        can_vary_in_batch(field, study.scenario.controller.kind) for axis in study.axes for field in axis.fields
    )
    stretches = 1 if pooled else min(STRETCHES, trials)
    count = min(TRIALS_TIMED, trials // stretches)
    starts = [trials * i // stretches for i in range(stretches)]
    seconds = [_seconds(study, Chunk(0, observer, study.chunks.stretch(first, count))) for first in starts]
    return sum(seconds) / len(seconds) / count


def _seconds(study: SweepStudy, piece: Chunk) -> float:
    """Time a piece by its preparation and by its pace once it has begun [s]."""
    begun: list[tuple[float, float]] = []
    enough = False

    def tick(share: float) -> None:
        nonlocal enough
        now = time.perf_counter()
        begun.append((now, share))
        if now - begun[0][0] > SECONDS:
            enough = True
            raise KeyboardInterrupt

    start = time.perf_counter()
    try:
        compute(study, piece, tick)
    except KeyboardInterrupt:
        if not enough:  # Ctrl-C
            raise
        (first, at), (last, to) = begun[0], begun[-1]
        return first - start + (last - first) / (to - at)
    return time.perf_counter() - start


StudyFields: TypeAlias = "dict[str, dict[str, FieldValue]]"
"""A study file's sections."""

STUDY, CHUNKS, TRIALS, CELLS, INDICES, REPORT = (
    "study.toml",
    "chunks",
    "trials.parquet",
    "cells.parquet",
    "indices.parquet",
    "report.md",
)
PICTURES = ("map_velocity_error.png", "map_push_error.png", "map_falls.png", "curves.png")
FILES = (STUDY, TRIALS, CELLS, INDICES, REPORT, *PICTURES)
"""Files of a sweep's folder, besides the chunks."""
KEY = b"cmg_mj.chunk"
"""Key of a chunk's hash in its file's metadata."""
GOES_ON = "finished trials are kept, and the same command resumes the sweep"


@dataclass(frozen=True)
class Store:
    """The chunks of a sweep in its folder.

    Attributes:
        folder: The sweep's folder.
        study: The sweep.
        hash: SHA-256 of the study, of its models' and tracks' files, and of the versions.
    """

    folder: Path
    study: SweepStudy
    hash: str

    @staticmethod
    def open(path: Path, study: SweepStudy, *, overwrite: bool = False) -> Store:
        """Begin a sweep, or go on with it where its folder is.

        Args:
            path: The folder; where something else is, NAME-2 and so on.
            study: The sweep.
            overwrite: Whether another result there is replaced, if cmg_mj wrote all of it.

        Raises:
            InputError: A file cannot be read, or the folder cannot be written.
        """
        fields = resolved(study)
        store = Store(path, study, hash_of(study, fields))
        try:
            folder = next(folder for folder in numbered(path) if _may_take(folder, fields, overwrite))
            store = Store(folder, study, store.hash)
            (folder / CHUNKS).mkdir(parents=True, exist_ok=True)
            for begun in folder.rglob(".*.partial*"):  # by a process that was killed
                begun.unlink(missing_ok=True)
            with whole_file(folder / STUDY) as temporary:
                temporary.write_text(tomli_w.dumps(fields), encoding="utf-8")
            chunks = [f"{CHUNKS}/{store.path(number).name}" for number in range(len(study.chunks))]
            write_marker(folder, [*FILES, *chunks], complete=False)
        except OSError as error:
            raise InputError(f"--out {path}: cannot be written: {error.strerror or error}") from error
        return store

    def left(self) -> list[int]:
        """List the numbers of the chunks that are not there, or do not read."""
        return [number for number in range(len(self.study.chunks)) if self.read(number) is None]

    def path(self, number: int) -> Path:
        """Name a chunk's file."""
        return self.folder / CHUNKS / f"{number:06d}.parquet"

    def read(self, number: int, columns: Sequence[str] | None = None) -> pa.Table | None:
        """Read a chunk's trials; None where the file is not there, damaged, or of another study or other versions."""
        try:
            # Opened here: Arrow takes no path with bytes that are no UTF-8.
            with (
                self.path(number).open("rb") as source,
                pq.ParquetFile(source, page_checksum_verification=True) as file,
            ):
                if file.schema_arrow != schema_of(self.study) or file.schema_arrow.metadata != self._metadata(number):
                    return None
                table = file.read(columns=None if columns is None else list(columns))
        except (OSError, ValueError, pa.ArrowException):
            return None
        return table if table.num_rows == self.study.chunks.size(number) else None

    def keep(self, number: int, table: pa.Table) -> None:
        """Keep a chunk's trials, which finishes the chunk.

        Raises:
            RunStopped: The trials cannot be written, or may be of a model that has been edited meanwhile.
        """
        if hash_of(self.study, resolved(self.study)) != self.hash:
            raise RunStopped(f"{self.study.scenario.plant.model}: a file of the sweep has changed since it began")
        # A flipped bit shows: each page has its checksum, and no dictionary or compression stands outside of pages.
        try:
            with whole_file(self.path(number)) as temporary, temporary.open("wb") as file:
                pq.write_table(
                    table.replace_schema_metadata(self._metadata(number)),
                    file,
                    compression="none",
                    use_dictionary=False,
                    write_page_checksum=True,
                )
        except OSError as error:
            raise RunStopped(f"{self.path(number)}: cannot be written: {error.strerror or error}; {GOES_ON}") from error

    def _metadata(self, number: int) -> dict[bytes, bytes]:
        return {KEY: f"{self.hash} {number}".encode()}

    def tables(self, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
        """Read the trials of a finished sweep, chunk by chunk; all columns, or some.

        Raises:
            InputError: A chunk cannot be read.
        """
        for number in range(len(self.study.chunks)):
            table = self.read(number, columns)
            if table is None:
                raise InputError(f"{self.path(number)}: cannot be read; the same command computes it again")
            yield table


def run(store: Store, left: Sequence[int], on_progress: Callable[[float], None] | None = None) -> None:
    """Run the chunks that are left.

    Args:
        store: The sweep's store.
        left: Numbers of the chunks.
        on_progress: Called after every tick with the trials done. A KeyboardInterrupt that it raises ends the sweep;
            what is finished is kept.
    """
    study, chunks = store.study, store.study.chunks
    done = study.trials - sum(chunks.size(number) for number in left)
    for number in left:
        tick = part_of_progress(on_progress, done, chunks.size(number))
        store.keep(number, table_of(study, compute(study, chunks[number], tick)))
        done += chunks.size(number)
        if on_progress:
            on_progress(done)


def _may_take(folder: Path, fields: StudyFields, overwrite: bool) -> bool:
    """Return whether a folder is new, or this sweep's; one that may be replaced is removed."""
    if not os.path.lexists(folder) or _without_versions(_study_in(folder)) == _without_versions(fields):
        return True
    if folder.is_dir() and not folder.is_symlink() and not any(folder.iterdir()):
        return True
    if overwrite and is_own(folder):
        remove(folder)
    return not os.path.lexists(folder)


def _study_in(folder: Path) -> StudyFields:
    try:
        return tomllib.loads((folder / STUDY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def _without_versions(fields: StudyFields) -> StudyFields:
    scenario = {key: value for key, value in fields.get("scenario", {}).items() if key != "versions"}
    return {**fields, "scenario": scenario}


def hash_of(study: SweepStudy, fields: StudyFields) -> str:
    """Hash everything that a chunk's figures depend on.

    Args:
        study: The sweep.
        fields: The study, resolved, with the versions.

    Raises:
        InputError: A file cannot be read.
    """
    digest = hashlib.sha256(json.dumps(fields, sort_keys=True).encode())
    varied = [str(value) for axis in study.axes if "plant.model" in axis.fields for value in axis.values]
    files = [
        path
        for model in varied or [study.scenario.plant.model]
        for path in model_files(find("models", model, ".xml", "plant.model ="))
    ]
    files += [Path(pivot.file) for pivot in study.scenario.pivot if pivot.file is not None]
    files += [Path(file) for axis in study.axes for file in varied_tracks(axis)]
    for path in files:
        try:
            content = path.read_bytes()
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
        digest.update(f"{path.name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def resolved(study: SweepStudy) -> StudyFields:
    """Write every default of a study's scenario out, as read back from a study file: the study reruns from that."""
    fields = prepare(study.scenario).resolved()
    varied = [field for axis in study.axes for field in axis.fields]
    for field in varied:
        section, _, name = field.rpartition(".")
        if section == "plant" and field != "plant.timestep_s":
            fields["plant"].pop(name, None)
    if study.scenario.plant.timestep_s is None:
        fields["plant"].pop("timestep_s", None)
    weights = study.scenario.controller.lqr
    if weights is not None:  # solved for anew on every plant
        fields["controller"]["lqr"] = weights.model_dump(mode="json")
    if weights is not None or any(f"{field}.".startswith("controller.lqr.") for field in varied):
        fields["controller"].pop("gains", None)
    if "controller.kind" in varied:  # each law has parameters of its own
        fields["controller"] = study.scenario.as_fields()["controller"]
    return tomllib.loads(tomli_w.dumps(study.as_fields(fields)))
