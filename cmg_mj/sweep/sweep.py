"""A sweep run from its first chunk to its tables, or from where it was stopped."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from cmg_mj.errors import InputError
from cmg_mj.experiment import prepare
from cmg_mj.sweep.study import Chunk, Study
from cmg_mj.sweep.trials import merge, table_of, write_table
from cmg_mj.sweep.work import compute, lost
from cmg_mj.trajectory import whole_file

STUDY, CHUNKS = "study.toml", "chunks"
ATTEMPTS = 3
"""A chunk that ends its process so often is given up: its trials are rows with a reason."""

OnProgress = Callable[[int, int], None]
"""(trials done, trials in all)."""


@dataclass(frozen=True)
class Store:
    """Where the chunks of a sweep are kept.

    A chunk is finished when its file has its final name. What is in it depends on the study and its number alone.

    Attributes:
        folder: The sweep's folder.
        study: The sweep.
    """

    folder: Path
    study: Study

    def open(self) -> int:
        """Begin, or go on with what is there.

        Returns:
            How many chunks are finished.

        Raises:
            InputError: The folder has another study.
        """
        asked = resolved(self.study)
        path = self.folder / STUDY
        if path.exists():
            _require_same(path, asked)
        else:
            with whole_file(path) as temporary:
                temporary.write_text(tomli_w.dumps(asked), encoding="utf-8")
        (self.folder / CHUNKS).mkdir(exist_ok=True)
        return sum(self.path(chunk).exists() for chunk in self.study.chunks)

    def path(self, chunk: Chunk) -> Path:
        """The finished chunk's file."""
        return self.folder / CHUNKS / f"{chunk.number:06d}.parquet"

    def finish(self, chunk: Chunk) -> None:
        """Compute a chunk and keep it."""
        begun = self.folder / CHUNKS / f"{chunk.number:06d}.begun"
        attempts = begun.stat().st_size if begun.exists() else 0
        with begun.open("ab") as file:  # a byte an attempt
            file.write(b".")
        if attempts >= ATTEMPTS:
            rows = lost(self.study, chunk, f"its process has ended {attempts} times while these trials ran")
        else:
            rows = compute(self.study, chunk)
        write_table(self.path(chunk), table_of(self.study, rows))
        begun.unlink()


def run(folder: Path, study: Study, on_progress: OnProgress | None = None) -> int:
    """Run what is not finished.

    Args:
        folder: Where the chunks are kept.
        study: The sweep.
        on_progress: Called after every chunk; a KeyboardInterrupt ends the sweep, what is finished is kept.

    Returns:
        How many trials had been finished before.
    """
    store = Store(folder, study)
    store.open()
    before = done = sum(len(chunk.trials) for chunk in study.chunks if store.path(chunk).exists())
    for chunk in study.chunks:
        if on_progress:
            on_progress(done, study.trials)
        if not store.path(chunk).exists():
            store.finish(chunk)
            done += len(chunk.trials)
    if on_progress:
        on_progress(done, study.trials)
    return before


def merged(folder: Path, study: Study, path: Path) -> None:
    """Write all trials of a finished sweep as one file."""
    store = Store(folder, study)
    merge([store.path(chunk) for chunk in study.chunks], path)


def sweep(study: Study) -> pa.Table:
    """Run a sweep in this process, keeping nothing on disk.

    Args:
        study: The sweep.

    Returns:
        Its trials.
    """
    return pa.concat_tables(table_of(study, compute(study, chunk)) for chunk in study.chunks)


def resolved(study: Study) -> dict[str, Any]:
    """The study with every default of its scenario written out: it reruns from that."""
    fields = prepare(study.scenario).resolved()
    for axis in study.axes:
        section, _, name = axis.field.rpartition(".")
        if axis.field == "plant.timestep_s" or section != "plant":
            continue
        fields["plant"].pop(name, None)
    if study.scenario.plant.timestep_s is None:
        fields["plant"].pop("timestep_s", None)
    return study.as_fields(fields)


def _require_same(path: Path, asked: Mapping[str, Any]) -> None:
    try:
        there = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is no study as cmg-mj writes it; name another folder") from error
    a, b = _flat(there), _flat(tomllib.loads(tomli_w.dumps(dict(asked))))
    for field in sorted(a.keys() | b.keys()):
        if a.get(field) != b.get(field) and not field.startswith("scenario.versions"):
            said = f"{field} = {a.get(field)} there, {b.get(field)} here"
            raise InputError(f"{path.parent}: holds another study: {said}; name another folder")


def _flat(fields: Any, at: str = "") -> dict[str, Any]:
    if not isinstance(fields, Mapping) or at == "vary":
        return {at: fields}
    return {name: leaf for key, part in fields.items() for name, leaf in _flat(part, f"{at}.{key}".strip(".")).items()}


def read_trials(path: Path) -> pa.Table:
    """The trials of a sweep that has been written."""
    return pq.read_table(path)
