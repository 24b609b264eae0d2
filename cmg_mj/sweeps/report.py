"""What a sweep says: tables for the terminal and `report.md`, and the files it writes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from cmg_mj import markdown
from cmg_mj.run_folder import RunFolder, Writers, write_text
from cmg_mj.summary_keys import heading, written
from cmg_mj.sweeps.cells import as_table
from cmg_mj.sweeps.store import TRIALS, Store, merged
from cmg_mj.sweeps.study import Study
from cmg_mj.sweeps.trials import write_table

if TYPE_CHECKING:
    from pathlib import Path

CELLS, REPORT = "cells.parquet", "report.md"
FILES = (TRIALS, CELLS, REPORT)
SHOWN = "velocity_rms_error_rad_s"
MOST_ROWS = 60
"""Of a table on the terminal or in the report; the files have all."""


def save(folder: RunFolder, store: Store, rows: Sequence[dict[str, Any]]) -> Path:
    """Write the tables and the report of a finished sweep, whose cells these are."""
    files: Writers = {
        TRIALS: lambda path: merged(store, path),
        CELLS: lambda path: write_table(path, as_table(rows)),
        REPORT: lambda path: write_text(path, report(store.study, rows)),
    }
    return folder.write(files)


def report(study: Study, rows: Sequence[dict[str, Any]]) -> str:
    """The report as Markdown."""
    counts = (
        f"{len(study.points)} points, {len(study.observers)} observers, {study.worlds} worlds: {study.trials} trials."
    )
    lines = [f"# {study.scenario.title or 'Sweep'}", "", counts, "", f"Mean {heading(SHOWN)}, with the falls:", ""]
    return "\n".join([*lines, cells_markdown(study, rows)])


def cells_markdown(study: Study, cells: Sequence[dict[str, Any]]) -> str:
    """A row a point, a column an observer."""
    fields = [axis.field for axis in study.axes]
    rows = []
    for number, point in enumerate(study.points[:MOST_ROWS]):
        first = number * len(study.observers)
        of = {row["observer"]: row for row in cells[first : first + len(study.observers)]}
        rows.append([*(_said(point[field]) for field in fields), *(_cell(of[name]) for name in study.observers)])
    table = markdown.table([*fields, *study.observers], rows, text_columns=0)
    more = len(study.points) - MOST_ROWS
    return table if more <= 0 else f"{table}\n\n{more} points more are in {CELLS}."


def _cell(row: dict[str, Any]) -> str:
    fell = f" [{row['fell']} fell]" if row["fell"] else ""
    stopped = f" [{row['stopped']} stopped]" if row["stopped"] else ""
    return written(SHOWN, row[SHOWN]) + fell + stopped


def _said(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
