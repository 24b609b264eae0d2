"""Trials as a table: `trials.parquet`, a row a trial."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from cmg_mj.results.files import whole_file
from cmg_mj.results.per_world_table import ID_COLUMNS
from cmg_mj.results.summary_keys import KEYS
from cmg_mj.studies.sweeps.chunk import COLUMNS
from cmg_mj.studies.sweeps.study import SweepStudy

if TYPE_CHECKING:
    import pyarrow as pa


FIGURES = [*(key for key in KEYS if key not in ("fell_fraction", "stopped_fraction")), "bias_deg"]
"""Of one trial."""


def schema_of(study: SweepStudy) -> pa.Schema:
    """The columns: the point's number, what is varied, who ran and how it ended, the figures."""
    import pyarrow as pa

    known = [(name, ID_COLUMNS[name]) for name in COLUMNS]
    return pa.schema([*point_columns(study), *known, *((name, "float64") for name in FIGURES)])


def point_columns(study: SweepStudy) -> list[tuple[str, str]]:
    """What every table of a sweep begins with: the point's number, what is varied."""
    types = [_type_of([axis.low] if axis.is_range else axis.values) for axis in study.axes]
    return [
        ("point", "int64"),
        *((field, kind) for axis, kind in zip(study.axes, types, strict=True) for field in axis.fields),
    ]


def _type_of(values: Sequence[Any]) -> str:
    if all(isinstance(value, bool) for value in values):
        return "bool"
    if all(type(value) is int and -(2**63) <= value < 2**63 for value in values):
        return "int64"
    if all(type(value) in (int, float) for value in values):
        return "float64"
    return "string"


def table_of(study: SweepStudy, rows: Iterable[Mapping[str, Any]]) -> pa.Table:
    """Rows of trials as a table; a figure that a trial does not have is null."""
    return as_table(rows, schema_of(study))


def as_table(rows: Iterable[Mapping[str, Any]], schema: pa.Schema) -> pa.Table:
    """Rows as a table; what a row does not have is null, and a value that no column can hold is its text."""
    import pyarrow as pa

    kept = list(rows)
    held = {"string": (str, repr), "double": (float, float)}  # Arrow takes no whole number beyond 2**53 for a double

    def column(name: str) -> list[Any]:
        kind, convert = held.get(str(schema.field(name).type), (object, repr))
        values = (row.get(name) for row in kept)
        return [value if value is None or isinstance(value, kind) else convert(value) for value in values]

    return pa.table({name: column(name) for name in schema.names}, schema=schema)


@contextmanager
def lasting(path: Path) -> Iterator[BinaryIO]:
    """A file to write, whole or not at all; a power cut is too late for it, too."""
    with whole_file(path) as temporary, temporary.open("wb") as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def write_table(path: Path, table: pa.Table) -> None:
    """Write Parquet that lasts."""
    import pyarrow.parquet as pq

    with lasting(path) as file:
        pq.write_table(table, file)


def as_bytes(table: pa.Table) -> bytes:
    """A table as it is sent (an Arrow stream)."""
    import pyarrow as pa

    into = pa.BufferOutputStream()
    with pa.ipc.new_stream(into, table.schema) as stream:
        stream.write_table(table)
    return into.getvalue().to_pybytes()


def from_bytes(sent: bytes) -> pa.Table:
    """The table that was sent."""
    import pyarrow as pa

    with pa.ipc.open_stream(sent) as stream:
        return stream.read_all()


def write_tables(path: Path, schema: pa.Schema, tables: Iterable[pa.Table]) -> None:
    """Write tables of the same columns as one Parquet file, a row group each, without holding them all."""
    import pyarrow.parquet as pq

    with path.open("wb") as file, pq.ParquetWriter(file, schema) as writer:
        for table in tables:
            writer.write_table(table)
