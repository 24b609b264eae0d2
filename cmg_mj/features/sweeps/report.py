"""A sweep's report: tables for the terminal and `report.md`, pictures, and the files of its folder."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmg_mj.core.errors import InputError, counted, listed
from cmg_mj.features.sweeps.cells import (
    CLOSE,
    Trials,
    cells_in_blocks,
    cells_of,
    cells_schema,
    fall_counts,
    fell_interval,
    lead_rows,
)
from cmg_mj.features.sweeps.chunks import CELLS, REPORT, RESUMES, TRIALS, Store, trials_schema
from cmg_mj.features.sweeps.pictures import CURVES, ERRORS, Picture, pictures_of
from cmg_mj.features.sweeps.study import SweepStudy, VariedField
from cmg_mj.results.folder import whole_file, write_text
from cmg_mj.results.intervals import finite_mean
from cmg_mj.results.summary_keys import Summary, SummaryValue, capitalised, format_figure, heading
from cmg_mj.results.tables import markdown_table
from cmg_mj.view.plots.figure import save_figure

MAX_ROWS = 60
"""Rows of a table on the terminal or in the report; the files have all."""
MAX_REASONS = 5
QUANTILES = {0.1: "10 % quantile", 0.5: "median", 0.9: "90 % quantile"}
"""Quantiles of a figure over the points of a design."""
ERROR = ERRORS[0]
ABOUT_MAPS = (
    "A cell's colour in the first panel is the observer of the smallest mean error among those that stood in every "
    "world. A dot: another one's mean difference to it, world by world, is within its 95 % interval. A dashed line in "
    "an observer's colour: half of its worlds fall beyond it. For falls, a dot says that Wilson's intervals overlap."
)
ABOUT_AHEAD = (
    "Baselines close no loop: their errors are those on the motion of a loop with the true rate, and its falls are "
    "shown as theirs. A dotted line in a baseline's colour: its error is less than the best observer's beyond it."
)
ABOUT_LEADS = (
    f"At how many points each observer has the least mean {heading(ERROR)} of those that stood in every world; "
    "surely: by its difference to every other, world by world, beyond 95 % intervals; close: stood in every world, "
    f"with at most {CLOSE:g} times the least error. Of a baseline: at how many its error is less than the best "
    "observer's, or no observer stood in every world."
)
ABOUT_CURVES = (
    "Bars are 95 % intervals. A cross: some worlds did not stand to the end, and the mean is that of the others, "
    "which had it easier."
)


def save(store: Store, trials: Trials) -> None:
    """Write the tables, the pictures and the report of a finished sweep.

    Raises:
        InputError: A file cannot be written.
    """
    study, pictures = store.study, pictures_of(trials)
    files: dict[str, Callable[[Path], object]] = {
        TRIALS: lambda path: _write_tables(path, trials_schema(study), store.tables()),
        CELLS: lambda path: _write_tables(path, cells_schema(study), cells_in_blocks(trials)),
    }
    for picture in pictures:
        files[f"{picture.name}.png"] = lambda path, it=picture: save_figure(path, it.draw(), it.title, dpi=100)
    files[REPORT] = lambda path: write_text(path, report(trials, pictures))
    for name, write in files.items():
        path = store.folder / name
        try:
            with whole_file(path) as temporary:
                write(temporary)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}; {RESUMES}") from error


def _write_tables(path: Path, schema: pa.Schema, tables: Iterable[pa.Table]) -> None:
    """Write tables of the same columns as one Parquet file, a row group each, without holding them all."""
    with path.open("wb") as file, pq.ParquetWriter(file, schema) as writer:
        for table in tables:
            writer.write_table(table)


def report(trials: Trials, pictures: Sequence[Picture]) -> str:
    """Write the report as Markdown."""
    study = trials.study
    sizes = ((study.n_points, "point"), (len(study.observers), "observer"), (study.worlds, "world"))
    counts = ", ".join(counted(n, noun) for n, noun in sizes)
    is_grid = study.sample is None
    return "\n\n".join(
        [
            f"# {study.scenario.title or 'Sweep'}",
            f"{counts}: {counted(study.trials, 'trial')}.",
            *_varied(study),
            *_pictures(trials, pictures),
            *_leads(trials),
            *_unfinished(trials),
            *(["## Cells", f"Mean {heading(ERROR)}, with the falls:"] if is_grid else ["## Observers over all points"]),
            *_cells(trials),
        ]
    )


def summary(trials: Trials) -> str:
    """Write for the terminal: cells, reasons of unfinished trials."""
    return "\n\n".join([*_cells(trials), *_unfinished(trials)[1:]])


def _varied(study: SweepStudy) -> list[str]:
    """Say what a table of the cells does not: a design's values of every field, a grid's fields that vary together."""
    if study.sample is not None:
        return ["Varied:", "\n".join(f"- {axis.option}: {_values(axis)}" for axis in study.axes)]
    together = [axis.fields for axis in study.axes if len(axis.fields) > 1]
    return [f"With {first} go, alike: {', '.join(others)}." for first, *others in together]


def _values(axis: VariedField) -> str:
    if not axis.values:
        return f"{axis.low:g} to {axis.high:g}{', evenly in the logarithm' if axis.log else ''}"
    return listed([_format_value(value) for value in axis.values])


def _format_value(value: SummaryValue) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _cells(trials: Trials) -> list[str]:
    """Show a grid's cells, a row a point, or how each observer does over the points of a design."""
    study = trials.study
    if study.sample is not None:
        return _over_points(trials)
    fields = [axis.field for axis in study.axes]
    rows, every_cell = [], cells_of(trials)
    for number in range(min(study.n_points, MAX_ROWS)):
        of_point = itertools.islice(every_cell, len(study.observers))
        values = study.point(number)
        rows.append([*(_format_value(values[field]) for field in fields), *map(_format_cell, of_point)])
    table = markdown_table([*fields, *study.observers], rows, text_columns=0)
    more = study.n_points - MAX_ROWS
    return [table, f"{more} points more are in {CELLS}."] if more > 0 else [table]


def _format_cell(row: Summary) -> str:
    counts = (f" [{row[outcome]} {outcome}]" for outcome in ("fell", "stopped") if row[outcome])
    return format_figure(ERROR, row[ERROR]) + "".join(counts)


def _over_points(trials: Trials) -> list[str]:
    """Make a table with a row an observer: its error's mean and quantiles over the points, and its falls."""
    study = trials.study
    error, (fell, known) = trials.figures[ERROR], fall_counts(trials)
    table = []
    for place, name in enumerate(study.observers):
        means = [mean for mean in map(finite_mean, error[:, place]) if mean is not None]
        figures = [np.mean(means), *np.quantile(means, list(QUANTILES))] if means else [None] * 4
        n_fell, n_known = fell[:, place].sum(), known[:, place].sum()
        share = f" ({100.0 * n_fell / n_known:.1f} %)" if n_known else ""
        formatted = [format_figure(ERROR, figure) for figure in figures]
        table.append([name, f"{len(means)} of {study.n_points}", *formatted, f"{n_fell} of {n_known}{share}"])
    return [
        f"{capitalised(heading(ERROR))} of a point: the mean over its worlds that stood, so that "
        "where some fell it is that of the easier ones. Over the points at which any stood:",
        markdown_table(["observer", "points", "mean", *QUANTILES.values(), "worlds that fell"], table),
        f"Every point is in {CELLS}.",
    ]


def _unfinished(trials: Trials) -> list[str]:
    """List the most frequent reasons why trials were refused or stopped; nothing if there are no such trials."""
    if not trials.reasons:
        return []
    about = f"{trials.reasons.total()} of {trials.study.trials} trials were refused or stopped; no mean counts them. "
    about += f"Every one's reason is in {TRIALS}, the most frequent:"
    kinds = trials.reasons.most_common(MAX_REASONS)
    lines = (f"- {n} {outcome}{', such as' if n > 1 else ''}: {text}" for (outcome, text), n in kinds)
    return ["## Refused and stopped", about, "\n".join(lines)]


def _pictures(trials: Trials, pictures: Sequence[Picture]) -> list[str]:
    """Show the pictures, and say how to read them."""
    if not pictures:
        return []
    links = [f"![{picture.title}]({picture.name}.png)" for picture in pictures]
    falls = [] if trials.fell.any() else ["No world fell."]
    about = ABOUT_CURVES if pictures[0].name == CURVES else ABOUT_MAPS
    return [*links, about, *([ABOUT_AHEAD] if trials.study.references else []), *falls]


def _leads(trials: Trials) -> list[str]:
    """Say who leads at how many points, of a study that compares observers with baselines; else nothing."""
    study = trials.study
    if not study.references:
        return []
    is_grid = study.sample is None
    table = []
    for row in lead_rows(trials, ERROR):
        _, low, high = fell_interval(row.leads, study.n_points)
        interval = [] if is_grid else [f"{100.0 * low:.1f} % to {100.0 * high:.1f} %"]
        leads, *counts = (f"{count} of {study.n_points}" for count in (row.leads, row.surely, row.close))
        table.append([f"{row.name} (baseline)" if row.is_baseline else row.name, leads, *interval, *counts])
    head = ["observer", "leads", *([] if is_grid else ["95 % interval"]), "surely", "close"]
    return ["## Who leads", ABOUT_LEADS, markdown_table(head, table)]
