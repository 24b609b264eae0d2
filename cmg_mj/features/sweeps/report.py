"""A sweep's report: tables for the terminal and `report.md`, pictures, and the files of its folder."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmg_mj.core.errors import InputError
from cmg_mj.features.sweeps.cells import CLOSE, Count, Trials, cells_in_blocks, cells_of, cells_schema, lead_rows
from cmg_mj.features.sweeps.chunks import CELLS, GOES_ON, INDICES, REPORT, TRIALS, Store, schema_of
from cmg_mj.features.sweeps.pictures import ERRORS, fall_counts, pictures_of
from cmg_mj.features.sweeps.sobol import FEWEST, LOST, IndexRow, index_table
from cmg_mj.features.sweeps.study import SweepStudy, VariedField, counted
from cmg_mj.results import markdown
from cmg_mj.results.files import whole_file
from cmg_mj.results.folder import write_text
from cmg_mj.results.summary_keys import KEYS, Summary, SummaryValue, capitalised, format_figure, heading
from cmg_mj.view.plots.figure import Picture, draw

MOST_ROWS = 60
"""Rows of a table on the terminal or in the report; the files have all."""
MOST_REASONS, MOST_VALUES = 5, 10
QUANTILES = (0.1, 0.5, 0.9)
"""Quantiles of a figure over the points of a design."""
ERROR = ERRORS[0]
ABOUT_MAPS = (
    "A cell's colour is the observer of the smallest mean error among those that stood in every world, the contours "
    "are its error. A dot: another one's mean difference to it, world by world, is within its 95 % interval. A line in "
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
    "Bands are 95 % intervals. A cross: some worlds did not stand to the end, and the mean is that of the others, "
    "which had it easier."
)
ABOUT_INDICES = (
    "Shares of the variance of a point's mean over its worlds: first order, what a field explains by itself; "
    "total, with all that it acts together with. In brackets bootstrap 95 % intervals. Decisive: its total index's "
    f"interval is above all others'. All figures are in {INDICES}."
)


def save(store: Store, trials: Trials, indices: Sequence[IndexRow]) -> None:
    """Write the tables, the pictures and the report of a finished sweep.

    Raises:
        InputError: A file cannot be written.
    """
    study, pictures = store.study, pictures_of(trials)
    files: dict[str, Callable[[Path], object]] = {
        TRIALS: lambda path: _write_tables(path, schema_of(study), store.tables()),
        CELLS: lambda path: _write_tables(path, cells_schema(study), cells_in_blocks(trials)),
        **{f"{picture.name}.png": lambda path, picture=picture: draw(path, picture) for picture in pictures},
    }
    if study.design == "sobol":
        files[INDICES] = lambda path: pq.write_table(index_table(indices), path)
    files[REPORT] = lambda path: write_text(path, report(trials, indices, pictures))
    for name, write in files.items():
        path = store.folder / name
        try:
            with whole_file(path, path.suffix) as temporary:
                write(temporary)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}; {GOES_ON}") from error


def _write_tables(path: Path, schema: pa.Schema, tables: Iterable[pa.Table]) -> None:
    """Write tables of the same columns as one Parquet file, a row group each, without holding them all."""
    with path.open("wb") as file, pq.ParquetWriter(file, schema) as writer:
        for table in tables:
            writer.write_table(table)


def report(trials: Trials, indices: Sequence[IndexRow], pictures: Sequence[Picture]) -> str:
    """Write the report as Markdown."""
    study = trials.study
    sizes = ((len(study.points), "point"), (len(study.observers), "observer"), (study.worlds, "world"))
    counts = ", ".join(counted(n, noun) for n, noun in sizes)
    is_grid = study.design == "grid"
    return "\n\n".join(
        [
            f"# {study.scenario.title or 'Sweep'}",
            f"{counts}: {counted(study.trials, 'trial')}.",
            *_varied(study),
            *_pictures(trials, pictures),
            *_leads(trials),
            *(_indices(study, indices) if study.design == "sobol" else []),
            *_unfinished(trials),
            *(["## Cells", f"Mean {heading(ERROR)}, with the falls:"] if is_grid else ["## Observers over all points"]),
            _cells(trials),
        ]
    )


def summary(trials: Trials, indices: Sequence[IndexRow]) -> str:
    """Write for the terminal: cells, reasons of unfinished trials, total indices."""
    parts = [_cells(trials)]
    counts = trials.reasons.counts
    if counts:
        more = len(counts) - 1
        others = f" (and {counted(more, 'other reason')}: see the report)" if more else ""
        parts.append(f"{_count_unfinished(trials)}. {trials.reasons.most(1)[0]}{others}")
    if indices:
        parts.append(_indices_in_short(indices))
    return "\n\n".join(parts)


def _varied(study: SweepStudy) -> list[str]:
    """Say what a table of the cells does not: a design's values of every field, a grid's fields that vary together."""
    if study.design == "grid":
        return [f"With {axis.field} go, alike: {', '.join(axis.also)}." for axis in study.axes if axis.also]
    return ["Varied:", "\n".join(f"- {axis.option}: {_values(axis)}" for axis in study.axes)]


def _values(axis: VariedField) -> str:
    if axis.is_range:
        scale = ", evenly in the logarithm" if axis.log else ""
        return f"{_format_value(axis.low)} to {_format_value(axis.high)}{scale}"
    values = [_format_value(value) for value in axis.values]
    if len(values) <= MOST_VALUES:
        return ", ".join(values)
    return f"{', '.join(values[: MOST_VALUES - 1])}, ..., {values[-1]} ({len(values)} values)"


def _format_value(value: SummaryValue) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _cells(trials: Trials) -> str:
    """Show a grid's cells, or how each observer does over the points of a design."""
    return _table_of_cells(trials) if trials.study.design == "grid" else _over_points(trials)


def _table_of_cells(trials: Trials) -> str:
    """Make a table with a row a point, a column an observer."""
    study = trials.study
    fields = [axis.field for axis in study.axes]
    rows, every_cell = [], cells_of(trials)
    for point in itertools.islice(study.points, MOST_ROWS):
        of_point = itertools.islice(every_cell, len(study.observers))
        rows.append([*(_format_value(point[field]) for field in fields), *map(_format_cell, of_point)])
    table = markdown.table([*fields, *study.observers], rows, text_columns=0)
    more = len(study.points) - MOST_ROWS
    return f"{table}\n\n{more} points more are in {CELLS}." if more > 0 else table


def _format_cell(row: Summary) -> str:
    counts = (f" [{row[outcome]} {outcome}]" for outcome in ("fell", "stopped") if row[outcome])
    return format_figure(ERROR, row[ERROR]) + "".join(counts)


def _over_points(trials: Trials) -> str:
    """Make a table with a row an observer: its error's mean and quantiles over the points, and its falls."""
    study = trials.study
    error, (fell, known) = trials.figure(ERROR), fall_counts(trials)
    table = []
    for place, name in enumerate(study.observers):
        means = _means(error[:, place])
        figures: list[float | None] = [None] * (1 + len(QUANTILES))
        if len(means):
            figures = [float(means.mean()), *np.quantile(means, QUANTILES)]
        falls = Count(int(fell[:, place].sum()), int(known[:, place].sum()))
        share = f" ({100.0 * falls.held / falls.of:.1f} %)" if falls.of else ""
        counts = [name, f"{len(means)} of {len(study.points)}"]
        table.append([*counts, *(format_figure(ERROR, figure) for figure in figures), falls.words + share])
    shares = ["median" if share == 0.5 else f"{100.0 * share:.0f} % quantile" for share in QUANTILES]
    return "\n\n".join(
        [
            f"{capitalised(heading(ERROR))} of a point: the mean over its worlds that stood, so that "
            "where some fell it is that of the easier ones. Over the points at which any stood:",
            markdown.table(["observer", "points", "mean", *shares, "worlds that fell"], table),
            f"Every point is in {CELLS}.",
        ]
    )


def _means(values: np.ndarray) -> np.ndarray:
    """Average over the known worlds of the points that have any, (n_points, n_worlds) -> (n_known,)."""
    known = np.isfinite(values)
    some = known.any(axis=1)
    return np.where(known, values, 0.0)[some].sum(axis=1) / known[some].sum(axis=1)


def _unfinished(trials: Trials) -> list[str]:
    """List the most frequent reasons why trials were refused or stopped; nothing if there are no such trials."""
    if not trials.reasons.counts:
        return []
    about = f"{_count_unfinished(trials)}; no mean counts them. Every one's reason is in {TRIALS}, the most frequent:"
    return ["## Refused and stopped", about, "\n".join(f"- {reason}" for reason in trials.reasons.most(MOST_REASONS))]


def _count_unfinished(trials: Trials) -> str:
    return f"{trials.reasons.counts.total()} of {trials.study.trials} trials were refused or stopped"


def _pictures(trials: Trials, drawings: Sequence[Picture]) -> list[str]:
    """Show the pictures, and say how to read them."""
    if not drawings:
        return []
    is_map = any(panel.map is not None for picture in drawings for panel in picture.panels)
    links = [f"![{picture.title}]({picture.name}.png)" for picture in drawings]
    falls = [] if trials.fell.any() else ["No world fell."]
    about = [ABOUT_MAPS if is_map else ABOUT_CURVES, *([ABOUT_AHEAD] if trials.study.references else [])]
    return [*links, *about, *falls]


def _leads(trials: Trials) -> list[str]:
    """Say who leads at how many points, of a study that compares observers with baselines; else nothing."""
    study = trials.study
    if not study.references:
        return []
    is_grid = study.design == "grid"
    table = []
    for row in lead_rows(trials, ERROR):
        low, high = row.leads.share[1:] if row.leads.share else (math.nan, math.nan)
        interval = [] if is_grid else [f"{100.0 * low:.1f} % to {100.0 * high:.1f} %"]
        name = f"{row.name} (baseline)" if row.is_baseline else row.name
        table.append([name, row.leads.words, *interval, row.surely.words, row.close.words])
    head = ["observer", "leads", *([] if is_grid else ["95 % interval"]), "surely", "close"]
    independent = " Of a design for indices, its independent points count." if study.design == "sobol" else ""
    return ["## Who leads", ABOUT_LEADS + independent, markdown.table(head, table)]


def _indices(study: SweepStudy, rows: Sequence[IndexRow]) -> list[str]:
    """Show the first-order and total indices of the figures that matter most."""
    about = ABOUT_INDICES
    if study.n < FEWEST:
        about += f" With fewer than {FEWEST} rows the intervals are too narrow, and nothing is called decisive."
    parts = ["## What the errors depend on: Sobol indices", about]
    for key, title in {**{key: heading(key) for key in ERRORS}, LOST: "share of worlds that fell or stopped"}.items():
        of_figure = [row for row in rows if row.figure == key]
        table = [
            [row.observer, row.field, _index(row, "first"), _index(row, "total"), "yes" if row.decisive else ""]
            for row in of_figure
            if not row.refused
        ]
        refused = {row.observer: row.refused for row in of_figure if row.refused}
        if of_figure:
            parts.append(f"### {capitalised(title)}")
        if table:
            headings = ["observer", "field", "first order", "total", "decisive"]
            parts.append(markdown.table(headings, table, text_columns=2))
        if refused:
            parts.append("\n".join(["Refused:", "", *(f"- {name}: {why}" for name, why in refused.items())]))
    return parts


def _indices_in_short(rows: Sequence[IndexRow]) -> str:
    """Show the total indices of the errors, or why there are none."""
    rows = [row for row in rows if row.figure in ERRORS]
    known = {(row.observer, row.field, row.figure): row for row in rows if not row.refused}
    columns = [key for key in ERRORS if any(figure == key for _, _, figure in known)]
    table = [
        [name, field, *(_total(known.get((name, field, key))) for key in columns)]
        for name, field in dict.fromkeys((name, field) for name, field, _ in known)
    ]
    parts = []
    if table:
        headings = ["observer", "field", *(f"total index, {KEYS[key].label}" for key in columns)]
        parts.append(markdown.table(headings, table, text_columns=2))
    if any(row.decisive for row in known.values()):
        parts.append("*: decisive, its interval is above all others'.")
    refused = dict.fromkeys((row.observer, row.figure, row.refused) for row in rows if row.refused)
    parts += [f"No indices of {name}, {KEYS[figure].label}: {why}." for name, figure, why in refused]
    return "\n\n".join(parts)


def _total(row: IndexRow | None) -> str:
    return "-" if row is None else f"{_index(row, 'total')}{'*' if row.decisive else ''}"


def _index(row: IndexRow, kind: str) -> str:
    value, low, high = (getattr(row, f"{kind}{end}") for end in ("", "_low", "_high"))
    return f"{value:.3f} [{low:.3f}, {high:.3f}]"
