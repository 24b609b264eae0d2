"""What a sweep says: tables for the terminal and `report.md`, and the files it writes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from cmg_mj import markdown
from cmg_mj.errors import InputError
from cmg_mj.picture import Picture
from cmg_mj.plots import draw
from cmg_mj.run_folder import RunFolder, Writers, write_text
from cmg_mj.summary_keys import heading, written
from cmg_mj.sweeps import report_parts
from cmg_mj.sweeps.cells import Trials, cells_in_blocks, cells_of, cells_schema
from cmg_mj.sweeps.indices import index_rows, index_table
from cmg_mj.sweeps.order import order_rows, order_table
from cmg_mj.sweeps.pictures import NAMES, pictures_of
from cmg_mj.sweeps.store import GOES_ON, TRIALS, Store, merged
from cmg_mj.sweeps.study import Study, counted
from cmg_mj.sweeps.trials import write_table, write_tables

if TYPE_CHECKING:
    from pathlib import Path

CELLS, ORDER, INDICES, REPORT = "cells.parquet", "order.parquet", "indices.parquet", "report.md"
FILES = (TRIALS, CELLS, ORDER, INDICES, REPORT, *NAMES)
"""Those that may be written."""
SHOWN = "velocity_rms_error_rad_s"
MOST_ROWS = 60
"""Of a table on the terminal or in the report; the files have all."""


class Found(NamedTuple):
    """What a finished sweep has found.

    Attributes:
        trials: Its trials.
        first: Rows of the cells of the first points, as many as are shown.
        order: A row a point, with a named order.
        indices: A row a figure, observer and field, of a design for them.
    """

    trials: Trials
    first: list[dict[str, Any]]
    order: list[dict[str, Any]]
    indices: list[dict[str, Any]]


def found_of(trials: Trials) -> Found:
    """What the trials say."""
    study = trials.study
    return Found(
        trials,
        list(itertools.islice(cells_of(trials), MOST_ROWS * len(study.observers))),
        order_rows(trials) if study.order else [],
        index_rows(trials) if study.design == "sobol" else [],
    )


def save(folder: RunFolder, store: Store, found: Found) -> Path:
    """Write the tables, the pictures and the report of a finished sweep.

    Raises:
        InputError: One cannot be written.
    """
    study, trials = store.study, found.trials
    pictures = pictures_of(trials)
    files: Writers = {
        TRIALS: lambda path: merged(store, path),
        CELLS: lambda path: write_tables(path, cells_schema(study), cells_in_blocks(trials)),
        **{f"{picture.name}.png": lambda path, picture=picture: draw(path, picture) for picture in pictures},
    }
    if study.order:
        files[ORDER] = lambda path: write_table(path, order_table(study, found.order))
    if study.design == "sobol":
        files[INDICES] = lambda path: write_table(path, index_table(found.indices))
    files[REPORT] = lambda path: write_text(path, report(found, pictures))
    try:
        return folder.write(files)
    except InputError as error:
        raise InputError(f"{error}; {GOES_ON}") from None


def report(found: Found, pictures: Sequence[Picture]) -> str:
    """The report as Markdown."""
    study = found.trials.study
    counts = ", ".join(
        counted(n, what)
        for n, what in ((len(study.points), "point"), (len(study.observers), "observer"), (study.worlds, "world"))
    )
    parts = [f"# {study.scenario.title or 'Sweep'}", f"{counts}: {counted(study.trials, 'trial')}."]
    parts += [f"With {axis.field} go, alike: {', '.join(axis.also)}." for axis in study.axes if axis.also]
    parts += report_parts.pictures(found.trials, pictures)
    if study.order:
        parts += report_parts.order(found.trials, found.order, MOST_ROWS)
    if study.design == "sobol":
        parts += report_parts.indices(study, found.indices)
    return "\n\n".join(
        [*parts, "## Cells", f"Mean {heading(SHOWN)}, with the falls:", cells_markdown(study, found.first)]
    )


def summary(found: Found) -> str:
    """For the terminal: the table of the cells, then in short how often the order holds, and the total indices."""
    study = found.trials.study
    parts = [cells_markdown(study, found.first)]
    if study.order:
        parts.append(report_parts.order_in_short(found.trials))
    if study.design == "sobol":
        parts.append(report_parts.indices_in_short(found.indices))
    return "\n\n".join(parts)


def cells_markdown(study: Study, cells: Sequence[dict[str, Any]]) -> str:
    """A row a point, a column an observer."""
    fields = [axis.field for axis in study.axes]
    rows = []
    for number in range(min(MOST_ROWS, len(study.points))):
        point, first = study.points[number], number * len(study.observers)
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
