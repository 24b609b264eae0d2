"""A sweep run from its first chunk to its tables, or from where it was stopped."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from cmg_mj.errors import InputError
from cmg_mj.experiment import prepare
from cmg_mj.sweeps.study import Chunk, Study
from cmg_mj.sweeps.trials import merge, table_of, write_table
from cmg_mj.sweeps.work import compute
from cmg_mj.trajectory import whole_file

STUDY, CHUNKS = "study.toml", "chunks"
TRIALS = "trials.parquet"
"""Files of a sweep's folder."""
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
            InputError: The folder has another study.
        """
        asked = resolved(self.study)
        path = self.folder / STUDY
        if path.exists():
            there = _require_same(path, asked)
            if there["sweep"].get(ORDER) != asked["sweep"].get(ORDER):
                _write(path, there | {"sweep": asked["sweep"]})
        else:
            _write(path, asked)
        (self.folder / CHUNKS).mkdir(exist_ok=True)
        return sum(len(chunk.trials) for chunk in self.study.chunks if self.path(chunk).exists())

    def path(self, chunk: Chunk) -> Path:
        """The finished chunk's file."""
        return self.folder / CHUNKS / f"{chunk.number:06d}.parquet"

    def finish(self, chunk: Chunk, on_progress: Callable[[float], None] | None = None) -> None:
        """Compute a chunk and keep it."""
        write_table(self.path(chunk), table_of(self.study, compute(self.study, chunk, on_progress)))


def run(store: Store, on_progress: Callable[[float], None] | None = None) -> None:
    """Run what is not finished.

    Args:
        store: The sweep's, opened.
        on_progress: Called after every tick with the trials done; a KeyboardInterrupt it raises ends the sweep, what
            is finished is kept.
    """
    done = 0
    for chunk in store.study.chunks:
        size = len(chunk.trials)
        if not store.path(chunk).exists():
            store.finish(chunk, None if on_progress is None else partial(_inside, on_progress, done, size))
        done += size
        if on_progress:
            on_progress(done)


def _inside(on_progress: Callable[[float], None], done: int, size: int, share: float) -> None:
    on_progress(done + share * size)


def merged(store: Store, path: Path) -> None:
    """Write all trials of a finished sweep as one file."""
    merge([store.path(chunk) for chunk in store.study.chunks], path)


def resolved(study: Study) -> dict[str, Any]:
    """The study with every default of its scenario written out: it reruns from that."""
    fields = prepare(study.scenario).resolved()
    for field in (field for axis in study.axes for field in axis.fields):
        section, _, name = field.rpartition(".")
        if field == "plant.timestep_s" or section != "plant":
            continue
        fields["plant"].pop(name, None)
    if study.scenario.plant.timestep_s is None:
        fields["plant"].pop("timestep_s", None)
    return study.as_fields(fields)


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


def read_chunks(store: Store) -> pa.Table:
    """The trials of a finished sweep."""
    return pa.concat_tables(pq.read_table(store.path(chunk)) for chunk in store.study.chunks)
