"""The chunks of a sweep on disk: a Parquet file each, there and readable, or computed again."""

from __future__ import annotations

import hashlib
import json
import os
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.features.sweeps.chunk import compute, part_of_progress, schema_of, table_of
from cmg_mj.features.sweeps.study import FieldValue, SweepStudy
from cmg_mj.features.sweeps.study_file import varied_tracks
from cmg_mj.inputs.files import find, model_files
from cmg_mj.results.folder import is_own, numbered, remove, whole_file, write_marker
from cmg_mj.runs.experiment import prepare

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
    files += [Path(file) for parts in study.scenario.feature_sections.values() for part in parts for file in part.files]
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
