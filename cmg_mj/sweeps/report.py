"""What a sweep says: tables for the terminal and `report.md`, and the files it writes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from cmg_mj import markdown
from cmg_mj.plots import draw
from cmg_mj.run_folder import RunFolder, Writers, write_text
from cmg_mj.summary_keys import heading, written
from cmg_mj.sweeps import report_parts
from cmg_mj.sweeps.cells import Trials, as_table
from cmg_mj.sweeps.indices import index_rows
from cmg_mj.sweeps.order import order_rows
from cmg_mj.sweeps.pictures import NAMES, pictures_of
from cmg_mj.sweeps.store import TRIALS, Store, merged
from cmg_mj.sweeps.study import Study
from cmg_mj.sweeps.trials import write_table

if TYPE_CHECKING:
    from pathlib import Path

CELLS, ORDER, INDICES, REPORT = "cells.parquet", "order.parquet", "indices.parquet", "report.md"
FILES = (TRIALS, CELLS, ORDER, INDICES, REPORT, *NAMES)
"""Those that may be written."""
SHOWN = "velocity_rms_error_rad_s"
MOST_ROWS = 60
"""Of a table on the terminal or in the report; the files have all."""


def save(folder: RunFolder, store: Store, trials: Trials, rows: Sequence[dict[str, Any]]) -> Path:
    """Write the tables, the pictures and the report of a finished sweep, whose cells these rows are."""
    study = store.study
    pictures = pictures_of(trials)
    files: Writers = {
        TRIALS: lambda path: merged(store, path),
        CELLS: lambda path: write_table(path, as_table(rows)),
        **{f"{picture.name}.png": lambda path, picture=picture: draw(path, picture) for picture in pictures},
    }
    parts = [*report_parts.pictures(trials, pictures)]
    if study.order:
        ordered = order_rows(trials)
        files[ORDER] = lambda path: write_table(path, as_table(ordered))
        parts += report_parts.order(trials, ordered, MOST_ROWS)
    if study.design == "sobol":
        found = index_rows(trials)
        files[INDICES] = lambda path: write_table(path, as_table(found))
        parts += report_parts.indices(study, found)
    files[REPORT] = lambda path: write_text(path, report(study, rows, parts))
    return folder.write(files)


def report(study: Study, rows: Sequence[dict[str, Any]], parts: Sequence[str] = ()) -> str:
    """The report as Markdown, with what stands between its head and the table of the cells."""
    counts = (
        f"{len(study.points)} points, {len(study.observers)} observers, {study.worlds} worlds: {study.trials} trials."
    )
    together = [f"With {axis.field} go, alike: {', '.join(axis.also)}." for axis in study.axes if axis.also]
    first = [f"# {study.scenario.title or 'Sweep'}", counts, *together]
    return "\n\n".join(
        [*first, *parts, "## Cells", f"Mean {heading(SHOWN)}, with the falls:", cells_markdown(study, rows)]
    )


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
