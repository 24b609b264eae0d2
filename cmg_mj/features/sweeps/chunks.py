"""The chunks of a sweep: a row a trial, computed here, kept on disk a Parquet file each, and their cost."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import re
import shutil
import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeAlias

import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from cmg_mj.core.errors import InputError, RunStopped, raised
from cmg_mj.features.sweeps.study import MAX_TRIALS, SweepStudy, Trial, varied_tracks
from cmg_mj.inputs.files import find, model_files, read_toml
from cmg_mj.results.folder import is_own, numbered, whole_file, write_marker
from cmg_mj.results.summary_keys import ID_COLUMNS, KEYS, Summary, SummaryValue
from cmg_mj.runs.batch import BatchKey
from cmg_mj.runs.experiment import Experiment, prepare, run_batch

# --- computed

OnProgress: TypeAlias = Callable[[float], None]
FIGURES = [*(key for key in KEYS if key not in ("fell_fraction", "stopped_fraction")), "bias_deg"]
"""Figures of one trial."""


def no_progress(done: float) -> None:
    """Show nothing."""


def compute(
    study: SweepStudy,
    observer: str,
    trials: Sequence[Trial],
    on_progress: OnProgress = no_progress,
    *,
    threads: int = 0,
) -> list[Summary]:
    """Run some of an observer's trials.

    A trial that fails is a row with the reason: values that do not fit, physics that fails, an observer that raises.

    Args:
        study: The sweep.
        observer: The observer in the loop, or a baseline.
        trials: The trials; those of a point stand together.
        on_progress: Called after every tick with the share that is done.
        threads: Number of threads that step the worlds; 0: as many as there are processors.

    Returns:
        A row a trial: the point's number, the varied values, and the figures of the run.
    """
    base = prepare(study.scenario_with(observer))
    results: dict[Trial, Summary] = {}
    batches: dict[BatchKey, dict[Trial, Experiment]] = {}
    for number, group in itertools.groupby(trials, key=lambda trial: trial[0]):
        of_point = list(group)
        try:
            experiment = base.with_settings(study.point(number))
            key = experiment.batch_key
        except InputError as error:  # values that do not fit each other: these trials never begin
            results |= dict.fromkeys(of_point, unfinished("refused", str(error)))
        else:
            batches.setdefault(key, {}).update(dict.fromkeys(of_point, experiment))

    def run(batch: Mapping[Trial, Experiment], tick: OnProgress) -> None:
        """Run trials in one batch. Where one raises, those that it stopped run again in halves, without it at last.

        Each trial is through or has raised by itself, so that no row depends on another's.
        """
        worlds = [world for _, world in batch]
        try:
            result = run_batch(list(batch.values()), worlds, keep_trajectory=False, on_progress=tick, threads=threads)
        except Exception as error:  # a user's observer may fail in any way
            results.update(dict.fromkeys(batch, unfinished("stopped", raised(error))))
            stopped = list(batch) if len(batch) > 1 else []
        else:
            if result.interrupted:
                raise KeyboardInterrupt
            rows = result.rows(observer if observer in study.baselines else None)
            results.update(zip(batch, rows, strict=True))
            stopped = [trial for trial, outcome in zip(batch, result.outcomes, strict=True) if outcome.with_others]
        half = (len(stopped) + 1) // 2
        for part in (stopped[:half], stopped[half:]):
            if part:
                run({trial: batch[trial] for trial in part}, tick)

    done = len(results) / len(trials)
    for batch in batches.values():
        share = len(batch) / len(trials)
        run(batch, part_of(on_progress, done, share / study.scenario.duration_s))
        done += share
    return rows_of(study, observer, results, trials)


def part_of(on_progress: OnProgress, start: float, size: float) -> OnProgress:
    """Make the report of a part of a progress, which begins at the start and adds the size."""
    return lambda share: on_progress(start + size * share)


def unfinished(outcome: str, reason: str) -> Summary:
    """Make the result of a trial that never ran to an end."""
    return {"outcome": outcome, "stood": False, "end_time_s": 0.0, "reason": reason}


def rows_of(
    study: SweepStudy, observer: str, results: Mapping[Trial, Summary], trials: Iterable[Trial]
) -> list[Summary]:
    """Put the point, the observer, the seed and the world before the result of each trial."""
    common = {"observer": observer, "seed": study.scenario.seed}
    return [
        {"point": number, **study.point(number), **common, "world": world, **results[number, world]}
        for number, world in trials
    ]


def trials_schema(study: SweepStudy) -> pa.Schema:
    """Declare the columns: the point's number, what is varied, observer, world and outcome, the figures."""
    known = [(name, kind) for name, kind in ID_COLUMNS.items() if name != "in_loop_of"]
    return pa.schema([*point_columns(study), *known, *((name, "float64") for name in FIGURES)])


def point_columns(study: SweepStudy) -> list[tuple[str, str]]:
    """Declare the first columns of every table of a sweep: the point's number, what is varied."""
    varied = [(field, _type_of(axis.values or [axis.low])) for axis in study.axes for field in axis.fields]
    return [("point", "int64"), *varied]


def _type_of(values: Sequence[SummaryValue]) -> str:
    try:
        kind = str(pa.array(values).type)
    except (pa.ArrowException, OverflowError):  # no column holds all
        return "string"
    return kind if kind in ("bool", "int64", "double") else "string"


def table_of(rows: Iterable[Mapping[str, SummaryValue]], schema: pa.Schema) -> pa.Table:
    """Make rows into a table; what a row does not have is null, and a value that no column can hold is its text."""
    every = list(rows)
    columns = {}
    for field in schema:
        values = [row.get(field.name) for row in every]
        if field.type == pa.string():
            values = [value if value is None or isinstance(value, str) else repr(value) for value in values]
        columns[field.name] = pa.array(values, field.type)
    return pa.table(columns, schema=schema)


# --- their cost

TIMED, SECONDS, STRETCHES = 256, 1.5, 8
"""Trials that stand for a chunk, how long they run once they have begun [s], and in how many places."""
POINTS = 4096
"""Points that stand for all of a study beyond `MAX_TRIALS`."""


def estimate_cost(study: SweepStudy) -> dict[str, float]:
    """Estimate minutes on this machine, as far as a piece of every observer can say.

    Returns:
        The figures that `--dry-run --json` prints.
    """
    thinned = study
    if study.trials > MAX_TRIALS and study.n_points > POINTS:  # points that lie alike, and are soon drawn
        thinned = replace(study, sample=POINTS)
    trials_an_observer = study.n_points * study.worlds
    return {
        "points": study.n_points,
        "observers": len(study.observers),
        "worlds": study.worlds,
        "trials": study.trials,
        "chunks": study.n_chunks,
        "minutes": sum(_seconds_a_trial(thinned, name) for name in study.observers) * trials_an_observer / 60.0,
    }


def _seconds_a_trial(study: SweepStudy, observer: str) -> float:
    """Time some of an observer's trials, in several stretches if not all can run in one batch [s]."""
    trials = study.n_points * study.worlds
    stretches = min(STRETCHES, trials) if study.apart else 1
    count = min(TIMED, trials // stretches)
    parts = [study.stretch(trials * i // stretches, count) for i in range(stretches)]
    return sum(_seconds(study, observer, part) for part in parts) / stretches / count


def _seconds(study: SweepStudy, observer: str, trials: Sequence[Trial]) -> float:
    """Time trials by their preparation and by their pace once they have begun [s]."""
    ticks: list[tuple[float, float]] = []

    def tick(share: float) -> None:
        ticks.append((time.perf_counter(), share))
        if ticks[-1][0] - ticks[0][0] > SECONDS:
            raise KeyboardInterrupt

    start = time.perf_counter()
    try:
        compute(study, observer, trials, tick)
    except KeyboardInterrupt:
        (first, at), (last, to) = ticks[0], ticks[-1]
        if last - first <= SECONDS:  # Ctrl-C
            raise
        return first - start + (last - first) / (to - at)
    return time.perf_counter() - start


# --- kept

StudyFields: TypeAlias = dict[str, dict[str, Any]]
"""A study file's sections."""
STUDY, CHUNKS, TRIALS, CELLS = "study.toml", "chunks", "trials.parquet", "cells.parquet"
REPORT = "report.md"
PICTURES = ("map_velocity_error.png", "map_push_error.png", "map_falls.png", "curves.png")
KEY = b"cmg_mj.chunk"
"""Key of a chunk's hash in its file's metadata."""
RESUMES = "finished trials are kept, and the same command resumes the sweep"


@dataclass(frozen=True)
class Store:
    """The chunks of a sweep in its folder: a file is there and readable, or computed again.

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
        hash = hash_of(study, fields)
        try:
            store = Store(next(place for place in numbered(path) if _may_take(place, fields, overwrite)), study, hash)
            (store.folder / CHUNKS).mkdir(parents=True, exist_ok=True)
            for begun in store.folder.rglob(".*.partial*"):  # by a process that was killed
                begun.unlink(missing_ok=True)
            with whole_file(store.folder / STUDY) as temporary:
                temporary.write_text(tomli_w.dumps(fields), encoding="utf-8")
            chunks = [f"{CHUNKS}/{store.path(number).name}" for number in range(study.n_chunks)]
            names = [STUDY, TRIALS, CELLS, REPORT, *PICTURES, *chunks]
            write_marker(store.folder, names, complete=False)
        except OSError as error:
            raise InputError(f"--out {path}: cannot be written: {error.strerror or error}") from error
        return store

    def left(self) -> list[int]:
        """List the numbers of the chunks that are not there, or do not read."""
        return [number for number in range(self.study.n_chunks) if self.read(number) is None]

    def path(self, number: int) -> Path:
        """Name a chunk's file."""
        return self.folder / CHUNKS / f"{number:06d}.parquet"

    def read(self, number: int, columns: list[str] | None = None) -> pa.Table | None:
        """Read a chunk's trials; None where the file is not there, damaged, or of another study or other versions."""
        try:
            # Opened here: Arrow takes no path with bytes that are no UTF-8.
            with (
                self.path(number).open("rb") as source,
                pq.ParquetFile(source, page_checksum_verification=True) as file,
            ):
                if not file.schema_arrow.equals(self._schema(number), check_metadata=True):
                    return None
                table = file.read(columns)
        except (OSError, ValueError, pa.ArrowException):
            return None
        return table if table.num_rows == self.study.chunk_size(number) else None

    def keep(self, number: int, rows: Iterable[Summary]) -> None:
        """Keep a chunk's trials, which finishes the chunk.

        Raises:
            RunStopped: The trials cannot be written, or may be of a model that has been edited meanwhile.
        """
        if hash_of(self.study, resolved(self.study)) != self.hash:
            raise RunStopped(f"{self.study.scenario.plant.model}: a file of the sweep has changed since it began")
        table = table_of(rows, self._schema(number))
        # A flipped bit shows: each page has its checksum, and no dictionary or compression stands outside of pages.
        how = {"compression": "none", "use_dictionary": False, "write_page_checksum": True}
        try:
            with whole_file(self.path(number)) as temporary, temporary.open("wb") as file:
                pq.write_table(table, file, **how)
        except OSError as error:
            raise RunStopped(f"{self.path(number)}: cannot be written: {error.strerror or error}; {RESUMES}") from error

    def _schema(self, number: int) -> pa.Schema:
        return trials_schema(self.study).with_metadata({KEY: f"{self.hash} {number}".encode()})

    def tables(self, columns: list[str] | None = None) -> Iterator[pa.Table]:
        """Read the trials of a finished sweep, chunk by chunk; all columns, or some.

        Raises:
            InputError: A chunk cannot be read.
        """
        for number in range(self.study.n_chunks):
            table = self.read(number, columns)
            if table is None:
                raise InputError(f"{self.path(number)}: cannot be read; the same command computes it again")
            yield table


def run(store: Store, left: Sequence[int], on_progress: OnProgress = no_progress) -> None:
    """Run the chunks that are left.

    Args:
        store: The sweep's store.
        left: Numbers of the chunks.
        on_progress: Called after every tick with the trials done. A KeyboardInterrupt that it raises ends the sweep;
            what is finished is kept.
    """
    study = store.study
    done = study.trials_without(left)
    for number in left:
        size = study.chunk_size(number)
        store.keep(number, compute(study, *study.chunk(number), part_of(on_progress, done, size)))
        done += size
        on_progress(done)


def _may_take(folder: Path, fields: StudyFields, overwrite: bool) -> bool:
    """Return whether a folder is new, empty, or this sweep's, versions apart; one that may be replaced is removed."""
    if folder.is_dir():
        try:
            there = read_toml(folder / STUDY, STUDY)
            there["scenario"] = {**there["scenario"], "versions": fields["scenario"]["versions"]}
        except (InputError, KeyError, TypeError):
            there = {}
        if not any(folder.iterdir()) or there == fields:
            return True
    if overwrite and is_own(folder):
        shutil.rmtree(folder)
    return not os.path.lexists(folder)


def hash_of(study: SweepStudy, fields: StudyFields) -> str:
    """Hash everything that a chunk's figures depend on, the files of a user's classes among it.

    Args:
        study: The sweep.
        fields: The study, resolved, with the versions.

    Raises:
        InputError: A file cannot be read.
    """
    text = json.dumps(fields, sort_keys=True)
    digest = hashlib.sha256(text.encode())
    models = [str(value) for axis in study.axes if "plant.model" in axis.fields for value in axis.values]
    tracks = [file for parts in study.scenario.feature_sections.values() for part in parts for file in part.files]
    tracks += [file for axis in study.axes for file in varied_tracks(axis)]
    files = [find("models", model, ".xml", "plant.model =") for model in models or [study.scenario.plant.model]]
    own = map(find_spec, re.findall(r'"([\w.]+):\w+"', text))
    tracks += [spec.origin for spec in own if spec and spec.origin]
    for path in [*itertools.chain.from_iterable(map(model_files, files)), *map(Path, tracks)]:
        try:
            content = path.read_bytes()
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
        digest.update(f"{path.name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def resolved(study: SweepStudy) -> StudyFields:
    """Write every default of a study's scenario out, as read back from a study file: the study reruns from that."""
    fields = prepare(study.scenario).resolved()
    for field in study.fields:
        section, _, name = field.rpartition(".")
        if section == "plant" and field != "plant.timestep_s":
            fields["plant"].pop(name, None)
    if study.scenario.plant.timestep_s is None:
        fields["plant"].pop("timestep_s", None)
    weights = study.scenario.controller.lqr
    if weights is not None:  # solved for anew on every plant
        fields["controller"]["lqr"] = weights.model_dump(mode="json")
    if weights is not None or any(f"{field}.".startswith("controller.lqr.") for field in study.fields):
        fields["controller"].pop("gains", None)
    if "controller.kind" in study.fields:  # each law has parameters of its own
        fields["controller"] = study.scenario.as_fields()["controller"]
    return tomllib.loads(tomli_w.dumps(study.as_fields(fields)))
