"""The table of a sweep's trials: `trials.parquet`, a row a trial."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cmg_mj.results.summary_keys import ID_COLUMNS, KEYS, SummaryValue
from cmg_mj.studies.sweeps.chunk import COLUMNS
from cmg_mj.studies.sweeps.study import SweepStudy

if TYPE_CHECKING:
    import pyarrow as pa


FIGURES = [*(key for key in KEYS if key not in ("fell_fraction", "stopped_fraction")), "bias_deg"]
"""Figures of one trial."""


def schema_of(study: SweepStudy) -> pa.Schema:
    """Declare the columns: the point's number, what is varied, observer, world and outcome, the figures."""
    import pyarrow as pa

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
    import pyarrow as pa

    cells = list(rows)

    def column(name: str) -> list[SummaryValue]:
        kind, values = str(schema.field(name).type), [row.get(name) for row in cells]
        if kind == "string":
            return [value if value is None or isinstance(value, str) else repr(value) for value in values]
        if kind == "double":  # Arrow takes no whole number beyond 2**53 for a double
            return [float(value) if isinstance(value, int) else value for value in values]
        return values

    return pa.table({name: column(name) for name in schema.names}, schema=schema)


def as_bytes(table: pa.Table) -> bytes:
    """Make a table into an Arrow stream."""
    import pyarrow as pa

    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as stream:
        stream.write_table(table)
    return sink.getvalue().to_pybytes()


def from_bytes(stream: bytes) -> pa.Table:
    """Read the table of `as_bytes`."""
    import pyarrow as pa

    with pa.ipc.open_stream(stream) as reader:
        return reader.read_all()


def write_tables(path: Path, schema: pa.Schema, tables: Iterable[pa.Table]) -> None:
    """Write tables of the same columns as one Parquet file, a row group each, without holding them all."""
    import pyarrow.parquet as pq

    with path.open("wb") as file, pq.ParquetWriter(file, schema) as writer:
        for table in tables:
            writer.write_table(table)
