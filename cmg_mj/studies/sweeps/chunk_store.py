"""The chunks of a sweep on disk; runs those that are not finished."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from cmg_mj.errors import InputError, RunStopped
from cmg_mj.results.files import is_plain_file, write_bytes, write_parquet
from cmg_mj.results.memory import release_free_memory
from cmg_mj.scenario.resolve import versions
from cmg_mj.studies.sweeps.axes import FieldValue
from cmg_mj.studies.sweeps.chunk import compute, part_of_progress
from cmg_mj.studies.sweeps.fingerprint import (
    ChunkFingerprint,
    StudyFields,
    as_read,
    damage,
    fingerprint_in,
    first_difference,
    hash_of_models,
    hash_of_study,
    hash_of_table,
    not_ours,
    other_version,
    resolved,
    without_asides,
)
from cmg_mj.studies.sweeps.study import SweepStudy
from cmg_mj.studies.sweeps.study_file import SECTIONS
from cmg_mj.studies.sweeps.trials import schema_of, table_of, write_tables

STUDY, CHUNKS = "study.toml", "chunks"
TRIALS = "trials.parquet"
"""Files of a sweep's folder."""
GOES_ON = "finished trials are kept, and the same command resumes the sweep"
AGAIN = "delete it, and it is computed again"


class Unreadable(Exception):
    """A chunk's file is there, but no table can be read from it."""


@dataclass(frozen=True)
class Store:
    """The chunks of a sweep in its folder.

    A chunk is finished when its file has its final name. Its content depends on the study and its number alone.

    Attributes:
        folder: The sweep's folder.
        study: The sweep.
    """

    folder: Path
    study: SweepStudy

    def open(self, on_damage: Callable[[str], None] | None = None) -> int:
        """Begin, or go on with the chunks that are there.

        Args:
            on_damage: Called with a message for each chunk that is damaged. It counts as not finished, and its file
                gets another name.

        Returns:
            How many trials are finished.

        Raises:
            InputError: The folder has another study or chunks of one, was computed with other versions and is not
                finished, or cannot be written.
        """
        path, chunks = self.folder / STUDY, self.folder / CHUNKS
        if chunks.is_symlink():  # out of the folder
            raise InputError(f"{chunks}: is a link: remove it, or name another folder")
        study = as_read(self._resolved)
        there = _require_same(path, study) if path.exists() else None
        marks = self._marks(on_damage)
        left = self.left()
        if left:
            versions_of: dict[Path, FieldValue | None] = {
                self.path(number): mark.versions for number, mark in marks.items()
            }
            if there is not None and versions_of:
                versions_of[path] = there["scenario"].get("versions")
            _require_versions(versions_of, self._ours.versions)
        elif marks:  # with whatever versions it is finished, the study says so
            study["scenario"]["versions"] = dict(marks[0].versions)
        try:
            if there != study:
                write_bytes(path, tomli_w.dumps(study).encode())
        except OSError as error:
            raise InputError(f"{self.folder}: cannot be written: {error.strerror or error}") from error
        try:
            chunks.mkdir(exist_ok=True)
        except OSError as error:
            why = "it is no folder" if chunks.exists() else error.strerror or error
            raise InputError(f"{chunks}: cannot be written: {why}") from error
        return self.study.trials - sum(self.study.chunks.size(number) for number in left)

    @cached_property
    def _resolved(self) -> StudyFields:
        return resolved(self.study)

    @cached_property
    def _ours(self) -> ChunkFingerprint:
        """The fingerprint of a chunk, but for its number, with the models as they are when the sweep is opened."""
        return ChunkFingerprint(hash_of_study(self._resolved), hash_of_models(self.study), "", versions())

    def _mark(self, number: int) -> ChunkFingerprint:
        return replace(self._ours, chunk=f"{number + 1} of {len(self.study.chunks)}")

    def _marks(self, on_damage: Callable[[str], None] | None) -> dict[int, ChunkFingerprint]:
        """Read the fingerprints of the finished chunks, all of which are the study's own; set damaged ones aside."""
        left = set(self.left())
        marks = {}
        for number in range(len(self.study.chunks)):
            if number in left:
                continue
            path = self.path(number)
            if not is_plain_file(path):
                raise InputError(f"{path}: is no file that cmg-mj writes; {AGAIN}, or name another folder")
            try:
                with self._opened(number) as (file, mark):
                    wrong = damage(file.read(), mark)
                    marks[number] = mark
            except Unreadable as error:
                wrong = str(error)
            if wrong:
                marks.pop(number, None)
                aside = _set_aside(path)
                if on_damage:
                    on_damage(f"{path}: {wrong}; it is computed again, and kept as {aside.name}, which may be deleted")
        return marks

    @contextmanager
    def _opened(self, number: int) -> Iterator[tuple[pq.ParquetFile, ChunkFingerprint]]:
        """Open a finished chunk's file and read its fingerprint.

        Raises:
            Unreadable: The file cannot be read.
            InputError: The file is not the study's own.
        """
        path = self.path(number)
        try:
            # Opened here: Arrow takes no path with bytes that are no UTF-8.
            with path.open("rb") as source, pq.ParquetFile(source) as file:
                mark = fingerprint_in(file.schema_arrow.metadata)
                why = not_ours(mark, self._mark(number))
                if mark is None or why:
                    raise InputError(f"{path}: {why}; {AGAIN}, or name another folder")
                yield file, mark
        except (OSError, pa.ArrowException) as error:
            raise Unreadable(f"cannot be read: {' '.join(str(error).split()).rstrip('.')}") from error

    def left(self) -> list[int]:
        """List the numbers of the chunks that are not finished."""
        return [number for number in range(len(self.study.chunks)) if not os.path.lexists(self.path(number))]

    def path(self, number: int) -> Path:
        """Name a chunk's file, which is there when the chunk is finished."""
        return self.folder / CHUNKS / f"{number:06d}.parquet"

    def keep(self, number: int, table: pa.Table) -> None:
        """Keep a chunk's trials, which finishes the chunk.

        Raises:
            RunStopped: The trials cannot be written, or may be of a model that has been edited meanwhile.
        """
        if hash_of_models(self.study) != self._ours.model:
            model = self.study.scenario.plant.model
            raise RunStopped(f"{model}: has changed since the sweep began; the finished trials used the earlier file")
        try:
            mark = replace(self._mark(number), rows=len(table), content=hash_of_table(table))
            marked = table.replace_schema_metadata(mark.as_metadata())
            write_parquet(self.path(number), marked, durable=True)
        except OSError as error:
            raise RunStopped(f"{self.path(number)}: cannot be written: {error.strerror or error}; {GOES_ON}") from error

    def tables(self, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
        """Read the trials of a finished sweep, chunk by chunk; all columns, or some.

        Raises:
            InputError: A chunk cannot be read, or is not the study's own.
        """
        names = None if columns is None else list(columns)
        for number in range(len(self.study.chunks)):
            try:
                with self._opened(number) as (file, _):
                    table = file.read(columns=names)
            except Unreadable as error:
                raise InputError(f"{self.path(number)}: {error}; {AGAIN}") from error
            yield table


def run(store: Store, on_progress: Callable[[float], None] | None = None) -> None:
    """Run the chunks that are not finished.

    Args:
        store: The sweep's store, opened.
        on_progress: Called after every tick with the trials done. A KeyboardInterrupt that it raises ends the sweep;
            what is finished is kept.
    """
    study, chunks = store.study, store.study.chunks
    left = store.left()
    done = study.trials - sum(chunks.size(number) for number in left)
    for number in left:
        size = chunks.size(number)
        tick = part_of_progress(on_progress, done, size)
        store.keep(number, table_of(study, compute(study, chunks[number], tick)))
        release_free_memory()
        done += size
        if on_progress:
            on_progress(done)


def merged(store: Store, path: Path) -> None:
    """Write all trials of a finished sweep as one file."""
    write_tables(path, schema_of(store.study), store.tables())


def _set_aside(path: Path) -> Path:
    """Rename a damaged file to a name that is free."""
    names = (f"{path.stem}{'' if number == 1 else f'-{number}'}.damaged" for number in count(1))
    aside = next(path.with_name(name) for name in names if not os.path.lexists(path.with_name(name)))
    try:
        return path.rename(aside)
    except OSError as error:
        raise InputError(f"{aside}: cannot be written: {error.strerror or error}") from error


def _require_versions(versions_of: Mapping[Path, FieldValue | None], ours: Mapping[str, str]) -> None:
    """Require that missing chunks are computed with the versions of those that are there."""
    for path, there in versions_of.items():
        difference = other_version(there if isinstance(there, Mapping) else {}, ours)
        if difference:
            raise InputError(
                f"{path}: {difference}; while trials are missing they must be the same: name another folder"
            )


def _require_same(path: Path, study: StudyFields) -> StudyFields:
    try:
        there = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        there = {}
    if any(not isinstance(there.get(section), dict) for section in SECTIONS):
        raise InputError(f"{path}: is no study as cmg-mj writes it; name another folder")
    other = first_difference(without_asides(there), without_asides(study))
    if other:
        raise InputError(f"{path.parent}: holds another study: {other}; name another folder")
    return there
