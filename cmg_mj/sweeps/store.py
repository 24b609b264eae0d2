"""A sweep run from its first chunk to its tables, or from where it was stopped."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from cmg_mj.errors import InputError, RunStopped
from cmg_mj.sweeps.identity import resolved
from cmg_mj.sweeps.memory import give_back
from cmg_mj.sweeps.study import Study
from cmg_mj.sweeps.trials import schema_of, table_of, write_table, write_tables
from cmg_mj.sweeps.work import compute
from cmg_mj.trajectory import whole_file

STUDY, CHUNKS = "study.toml", "chunks"
TRIALS = "trials.parquet"
"""Files of a sweep's folder."""
GOES_ON = "what is finished is kept, and the same command goes on from there"
ORDER = "order"
"""What a study file says in [sweep] that no trial depends on: another one is no other study."""


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
            How many trials are finished.

        Raises:
            InputError: The folder has another study, or cannot be written.
        """
        asked = resolved(self.study)
        path = self.folder / STUDY
        there = _require_same(path, asked) if path.exists() else None
        try:
            if there is None:
                _write(path, asked)
            elif there["sweep"].get(ORDER) != asked["sweep"].get(ORDER):
                _write(path, there | {"sweep": asked["sweep"]})
            (self.folder / CHUNKS).mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"{self.folder}: cannot be written: {error.strerror or error}") from error
        chunks = self.study.chunks
        return self.study.trials - sum(chunks.size(number) for number in self.left())

    def left(self) -> list[int]:
        """Numbers of the chunks that are not finished."""
        return [number for number in range(len(self.study.chunks)) if not self.path(number).exists()]

    def path(self, number: int) -> Path:
        """A chunk's file, which is there when it is finished."""
        return self.folder / CHUNKS / f"{number:06d}.parquet"

    def keep(self, number: int, table: pa.Table) -> None:
        """Keep a chunk's trials: it is finished.

        Raises:
            RunStopped: They cannot be written.
        """
        try:
            write_table(self.path(number), table)
        except OSError as error:
            raise RunStopped(f"{self.path(number)}: cannot be written: {error.strerror or error}; {GOES_ON}") from error

    def tables(self, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
        """The trials of a finished sweep, chunk by chunk; all columns of them, or some.

        Raises:
            InputError: A chunk cannot be read.
        """
        names = None if columns is None else list(columns)
        for number in range(len(self.study.chunks)):
            path = self.path(number)
            try:
                yield pq.read_table(path, columns=names)
            except (OSError, pa.ArrowException) as error:
                why = " ".join(str(error).split())
                raise InputError(f"{path}: cannot be read: {why}; delete it, and it is computed again") from error


def run(store: Store, on_progress: Callable[[float], None] | None = None) -> None:
    """Run what is not finished.

    Args:
        store: The sweep's, opened.
        on_progress: Called after every tick with the trials done; a KeyboardInterrupt it raises ends the sweep, what
            is finished is kept.
    """
    study, chunks = store.study, store.study.chunks
    left = store.left()
    done = study.trials - sum(chunks.size(number) for number in left)
    for number in left:
        size = chunks.size(number)
        tick = None if on_progress is None else partial(_inside, on_progress, done, size)
        store.keep(number, table_of(study, compute(study, chunks[number], tick)))
        give_back()
        done += size
        if on_progress:
            on_progress(done)


def _inside(on_progress: Callable[[float], None], done: int, size: int, share: float) -> None:
    on_progress(done + share * size)


def merged(store: Store, path: Path) -> None:
    """Write all trials of a finished sweep as one file."""
    write_tables(path, schema_of(store.study), store.tables())


def _write(path: Path, fields: Mapping[str, Any]) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(tomli_w.dumps(dict(fields)), encoding="utf-8")


def _require_same(path: Path, asked: Mapping[str, Any]) -> dict[str, Any]:
    try:
        there = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is no study as cmg-mj writes it; name another folder") from error
    a, b = _flat(there), _flat(tomllib.loads(tomli_w.dumps(dict(asked))))
    for field in sorted(a.keys() | b.keys()):
        if field != f"sweep.{ORDER}" and a.get(field) != b.get(field) and not field.startswith("scenario.versions"):
            said = f"{field} = {a.get(field)} there, {b.get(field)} here"
            raise InputError(f"{path.parent}: holds another study: {said}; name another folder")
    return there


def _flat(fields: Any, at: str = "") -> dict[str, Any]:
    if not isinstance(fields, Mapping) or at == "vary":
        return {at: fields}
    return {name: leaf for key, part in fields.items() for name, leaf in _flat(part, f"{at}.{key}".strip(".")).items()}
