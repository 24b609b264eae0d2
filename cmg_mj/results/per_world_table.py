"""The table of a run's worlds: a row per observer and world."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from cmg_mj.results.summary_keys import Summary

if TYPE_CHECKING:
    import pyarrow as pa


ID_COLUMNS = {
    "observer": "string",
    "in_loop_of": "string",
    "world": "int64",
    "seed": "int64",
    "outcome": "string",
    "stood": "bool",
    "end_time_s": "float64",
    "reason": "string",
}
"""Columns before the figures, and their types. `in_loop_of` names the observer in the loop, for those that are not.

Figures of a world that did not stand to the end are those until then: `stood` is false, and no mean may count them.
"""


def as_table(rows: Iterable[Summary]) -> pa.Table:
    """Make rows, a world each, into a table. A figure that an observer or a world does not have is null."""
    import pyarrow as pa

    worlds = list(rows)
    figures = dict.fromkeys(key for row in worlds for key in row if key not in ID_COLUMNS)
    schema = pa.schema([*ID_COLUMNS.items(), *((key, "float64") for key in figures)])
    return pa.table({name: [row.get(name) for row in worlds] for name in schema.names}, schema=schema)
