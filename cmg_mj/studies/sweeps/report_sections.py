"""Sections of a sweep's report, each a list of paragraphs: cells, unfinished trials, pictures, order, Sobol indices."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from cmg_mj.results import markdown
from cmg_mj.results.intervals import Interval
from cmg_mj.results.summary_keys import KEYS, Summary, SummaryValue, capitalised, format_figure, heading
from cmg_mj.studies.sweeps.axes import VariedField
from cmg_mj.studies.sweeps.cells import Trials, cells_of
from cmg_mj.studies.sweeps.leads import CLOSE, lead_rows
from cmg_mj.studies.sweeps.order import (
    ORDER_FIGURES,
    OrderCount,
    by_quarters,
    figures_of,
    order_of_points,
    pairs_of,
)
from cmg_mj.studies.sweeps.pictures import ERRORS, fall_counts
from cmg_mj.studies.sweeps.sobol import FEWEST, LOG_RATIO, LOST, IndexRow
from cmg_mj.studies.sweeps.study import SweepStudy
from cmg_mj.visualization.plots.figure_spec import Picture

CELLS, ORDER, INDICES = "cells.parquet", "order.parquet", "indices.parquet"
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
ABOUT_ORDER = (
    "At how many points it holds by the means over the worlds, and in how many worlds. A fall is worse than any "
    "error. Left out are points and worlds that cannot tell: a trial was refused or stopped, or two next to each "
    "other fell and the others do not break the order."
)
ABOUT_INDICES = (
    "Shares of the variance of a point's mean over its worlds: first order, what a field explains by itself; "
    "total, with all that it acts together with. In brackets bootstrap 95 % intervals. Decisive: its total index's "
    f"interval is above all others'. All figures are in {INDICES}."
)
SHARE_HEADINGS = ("share", "95 % interval")


def varied(study: SweepStudy) -> list[str]:
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


def cells(trials: Trials) -> list[str]:
    """Show a grid's cells, or how each observer does over the points of a design."""
    if trials.study.design == "grid":
        return ["## Cells", f"Mean {heading(ERROR)}, with the falls:", cells_in_short(trials)]
    return ["## Observers over all points", cells_in_short(trials)]


def cells_in_short(trials: Trials) -> str:
    """Do the same without a heading, for the terminal."""
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
    return "\n\n".join([table, *_further_points(study, CELLS)])


def _further_points(study: SweepStudy, file: str) -> list[str]:
    more = len(study.points) - MOST_ROWS
    return [f"{more} points more are in {file}."] if more > 0 else []


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
        falls = OrderCount(int(fell[:, place].sum()), int(known[:, place].sum()))
        share = f" ({100.0 * falls.held / falls.decided:.1f} %)" if falls.decided else ""
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


def unfinished(trials: Trials) -> list[str]:
    """List the most frequent reasons why trials were refused or stopped; nothing if there are no such trials."""
    reasons = trials.reasons
    if not reasons.trials:
        return []
    about = (
        f"{_count_unfinished(trials)}; no mean counts them. Every one's reason is in trials.parquet, the most frequent:"
    )
    return ["## Refused and stopped", about, "\n".join(f"- {reason}" for reason in reasons.most(MOST_REASONS))]


def unfinished_in_short(trials: Trials) -> list[str]:
    """Do the same in one line."""
    if not trials.reasons.trials:
        return []
    more = trials.reasons.kinds - 1
    others = f" (and {more} other {'reason' if more == 1 else 'reasons'}: see the report)" if more else ""
    return [f"{_count_unfinished(trials)}. {trials.reasons.most(1)[0]}{others}"]


def _count_unfinished(trials: Trials) -> str:
    return f"{trials.reasons.trials} of {trials.study.trials} trials were refused or stopped"


def pictures(trials: Trials, drawings: Sequence[Picture]) -> list[str]:
    """Show the pictures, and say how to read them."""
    if not drawings:
        return []
    is_map = any(panel.map is not None for picture in drawings for panel in picture.panels)
    links = [f"![{picture.title}]({picture.name}.png)" for picture in drawings]
    falls = [] if trials.fell.any() else ["No world fell."]
    about = [ABOUT_MAPS if is_map else ABOUT_CURVES, *([ABOUT_AHEAD] if trials.study.references else [])]
    return [*links, *about, *falls]


def leads(trials: Trials) -> list[str]:
    """Say who leads at how many points, of a study that compares observers with baselines; else nothing."""
    study = trials.study
    if not study.references:
        return []
    table = []
    for row in lead_rows(trials, ERROR):
        share = [] if study.design == "grid" else _share(row.leads.share)[1:]
        name = f"{row.name} (baseline)" if row.is_baseline else row.name
        table.append([name, row.leads.words, *share, row.surely.words, row.close.words])
    interval = [] if study.design == "grid" else SHARE_HEADINGS[1:]
    head = ["observer", "leads", *interval, "surely", "close"]
    independent = " Of a design for indices, its independent points count." if study.design == "sobol" else ""
    return ["## Who leads", ABOUT_LEADS + independent, markdown.table(head, table)]


def order(trials: Trials, counts: Mapping[str, Sequence[OrderCount]]) -> list[str]:
    """Say how often the named order holds."""
    study = trials.study
    orders = [study.order] if len(study.order) == 2 else [study.order, *pairs_of(study.order)]
    is_sample = study.design == "sample"  # points of a grid are no sample of anything
    table = []
    for key, points in counts.items():
        worlds = OrderCount(sum(count.held for count in points), sum(count.decided for count in points)).words
        for part in orders:
            count = order_of_points(trials, key, part)
            share = _share(count.share) if is_sample else []
            row = [heading(key), " < ".join(part), count.words, *share, worlds if part is study.order else ""]
            table.append(row)
    headings = ["counted by", "order", "points", *(SHARE_HEADINGS if is_sample else ()), "worlds"]
    title = f"## The order {' < '.join(study.order)}"
    parts = [title, ABOUT_ORDER, markdown.table(headings, table, text_columns=2)]
    if study.design != "grid":
        return [*parts, *(_quarters(trials) if is_sample else []), f"Every point is in {ORDER}."]
    fields = [axis.field for axis in study.axes]
    table = [
        [*(_format_value(point[field]) for field in fields), count.words, *_share(count.share)]
        for point, count in itertools.islice(
            zip(study.points, counts.get(ORDER_FIGURES[0], ()), strict=False), MOST_ROWS
        )
    ]
    return [
        *parts,
        f"World by world, by the {heading(ORDER_FIGURES[0])}:",
        markdown.table([*fields, "worlds", *SHARE_HEADINGS], table, text_columns=0),
        *_further_points(study, ORDER),
    ]


def _quarters(trials: Trials) -> list[str]:
    """Say where in the fields' ranges the order holds."""
    key = figures_of(trials)[0]
    table = [
        [field, f"{low:.4g} to {high:.4g}" if low < high else f"{low:.4g}", count.words, *_share(count.share)]
        for field, low, high, count in by_quarters(trials, key)
    ]
    sentence = f"By the {heading(key)}, by each quarter of a field's range, or each value of a list:"
    return [sentence, markdown.table(["field", "values", "points", *SHARE_HEADINGS], table, text_columns=2)]


def order_in_short(trials: Trials) -> str:
    """Say in a sentence how often the order holds, by the figure that comes first."""
    study, key = trials.study, figures_of(trials)[0]
    count = order_of_points(trials, key, study.order)
    sentence = f"The order {' < '.join(study.order)}: by the {heading(key)} it holds at {count.words} points"
    if count.share is not None and study.design == "sample":  # points of a grid are no sample of anything
        share, interval = _share(count.share)
        sentence += f" ({share}, Wilson's 95 % interval {interval})"
    unknown = len(study.points) - count.decided
    return f"{sentence}; {unknown} points cannot tell." if unknown else f"{sentence}."


def indices(study: SweepStudy, rows: Sequence[IndexRow]) -> list[str]:
    """Show the first-order and total indices of the figures that matter most."""
    about = ABOUT_INDICES
    if study.n < FEWEST:
        about += f" With fewer than {FEWEST} rows the intervals are too narrow, and nothing is called decisive."
    parts = ["## What the errors depend on: Sobol indices", about]
    titles = {key: heading(key) for key in ERRORS} | {LOST: "share of worlds that fell or stopped"}
    titles |= {f"{LOG_RATIO}{key}": f"logarithm of the ratio: {heading(key)}" for key in ORDER_FIGURES}
    for key, title in titles.items():
        figure_rows = [row for row in rows if row.figure == key]
        table = [
            [row.observer, row.field, _index(row, "first"), _index(row, "total"), "yes" if row.decisive else ""]
            for row in figure_rows
            if not row.refused
        ]
        if figure_rows:
            parts.append(f"### {capitalised(title)}")
        if table:
            headings = ["observer", "field", "first order", "total", "decisive"]
            parts.append(markdown.table(headings, table, text_columns=2))
        refused = {row.observer: row.refused for row in figure_rows if row.refused}
        if refused:
            parts.append("\n".join(["Refused:", "", *(f"- {name}: {why}" for name, why in refused.items())]))
    return parts


def indices_in_short(rows: Sequence[IndexRow]) -> str:
    """Show the total indices of the errors and of the logarithms of their ratios, or why there are none."""
    known: dict[tuple[str, str, str], IndexRow] = {}
    refused: dict[tuple[str, str], dict[str, None]] = {}
    for row in rows:
        figure = row.figure.removeprefix(LOG_RATIO)
        name = row.observer if figure == row.figure else f"log({row.observer})"
        if figure in ERRORS and row.refused:
            refused.setdefault((name, row.refused), {})[KEYS[figure].label] = None
        elif figure in ERRORS:
            known[name, row.field, figure] = row
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
    parts += [f"No indices of {name}, {', '.join(labels)}: {why}." for (name, why), labels in refused.items()]
    return "\n\n".join(parts)


def _total(row: IndexRow | None) -> str:
    return "-" if row is None else f"{_index(row, 'total')}{'*' if row.decisive else ''}"


def _index(row: IndexRow, kind: str) -> str:
    value, low, high = (getattr(row, f"{kind}{end}") for end in ("", "_low", "_high"))
    return f"{value:.3f} [{low:.3f}, {high:.3f}]"


def _share(share: Interval | None) -> list[str]:
    if share is None:
        return ["-", "-"]
    return [_percent(share.mean), f"{_percent(share.low)} to {_percent(share.high)}"]


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"
