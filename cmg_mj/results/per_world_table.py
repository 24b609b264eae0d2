"""Every world kept: a table with a row per observer and world."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from cmg_mj.results.summary_keys import NESTED, OPEN_LOOP_SECTIONS
from cmg_mj.results.trajectory import whole_file

if TYPE_CHECKING:
    import pyarrow as pa


class WorldEnd(Protocol):
    """How a world ended."""

    kind: Any
    time_s: float
    reason: str


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


def world_rows(
    loop: str,
    who: str,
    seed: int,
    worlds: Sequence[int],
    outcomes: Sequence[WorldEnd],
    summaries: Sequence[Mapping[str, Any]],
) -> list[dict[str, Any]]:
    """One observer's rows.

    Args:
        loop: The observer in the loop.
        who: The same, or one of its open-loop observers or references.
        seed: The run's seed.
        worlds: Their numbers, (n_worlds,).
        outcomes: How each ended, (n_worlds,).
        summaries: Each world's numbers, (n_worlds,).

    Returns:
        A row a world, by column.
    """
    rows = []
    for number, outcome, summary in zip(worlds, outcomes, summaries, strict=True):
        figures = summary if who == loop else open_loop_figures(summary)[who]
        rows.append(
            {
                "observer": who,
                "in_loop_of": None if who == loop else loop,
                "world": number,
                "seed": seed,
                "outcome": outcome.kind,
                "stood": outcome.kind == "done",
                "end_time_s": outcome.time_s,
                "reason": outcome.reason or None,
                **{key: value for key, value in figures.items() if key not in NESTED},
            }
        )
    return rows


def open_loop_figures(summary: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Of a summary the figures of everything that rode along, by name: open-loop observers, then references."""
    return {name: figures for nested in OPEN_LOOP_SECTIONS for name, figures in summary.get(nested, {}).items()}


def as_table(rows: Iterable[Mapping[str, Any]]) -> pa.Table:
    """Rows as a table. A figure that an observer or a world does not have is null."""
    import pyarrow as pa

    kept = list(rows)
    figures = dict.fromkeys(key for row in kept for key in row if key not in ID_COLUMNS)
    schema = pa.schema([*ID_COLUMNS.items(), *((key, "float64") for key in figures)])
    return pa.table({name: [row.get(name) for row in kept] for name in schema.names}, schema=schema)


def save_table(path: Path, table: pa.Table, metadata: Mapping[str, Any]) -> None:
    """Write the table as Parquet, whole or not at all."""
    import pyarrow.parquet as pq

    table = table.replace_schema_metadata({b"cmg_mj": json.dumps(metadata).encode()})
    # Opened here: Arrow takes no path with bytes that are no UTF-8.
    with whole_file(path) as temporary, temporary.open("wb") as file:
        pq.write_table(table, file)
