"""Of a sweep's report what is said of its cells: those of a grid one by one, those of a design in a summary."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from cmg_mj.results import markdown
from cmg_mj.results.summary_keys import format_figure, heading
from cmg_mj.studies.sweeps.axes import VariedField
from cmg_mj.studies.sweeps.cells import Trials, cells_of
from cmg_mj.studies.sweeps.plot_scales import ERRORS, fall_counts
from cmg_mj.studies.sweeps.study import SweepStudy

CELLS = "cells.parquet"
MOST_ROWS = 60
"""Of a table on the terminal or in the report; the files have all."""
MOST_REASONS, MOST_VALUES = 5, 10
QUANTILES = (0.1, 0.5, 0.9)
"""Of a figure over the points of a design."""
ERROR = ERRORS[0]


def cells(trials: Trials) -> list[str]:
    """The part of the report."""
    if trials.study.design == "grid":
        return ["## Cells", f"Mean {heading(ERROR)}, with the falls:", in_short(trials)]
    return ["## Observers over all points", in_short(trials)]


def varied(study: SweepStudy) -> list[str]:
    """What a table of the cells does not say: of a design every field's values, of a grid those that go alike."""
    if study.design == "grid":
        return [f"With {axis.field} go, alike: {', '.join(axis.also)}." for axis in study.axes if axis.also]
    return ["Varied:", "\n".join(f"- {axis.written}: {_values(axis)}" for axis in study.axes)]


def in_short(trials: Trials) -> str:
    """For the terminal, too: a grid's cells, or how each observer does over the points of a design."""
    return _table_of_cells(trials) if trials.study.design == "grid" else _over_points(trials)


def unfinished(trials: Trials) -> list[str]:
    """The part of the report on trials that were refused or stopped: the most frequent reasons."""
    reasons = trials.reasons
    if not reasons.trials:
        return []
    about = f"{_how_many(trials)}; no mean counts them. Every one's reason is in trials.parquet, the most frequent:"
    return ["## Refused and stopped", about, "\n".join(f"- {said}" for said in reasons.most(MOST_REASONS))]


def unfinished_in_short(trials: Trials) -> str:
    """The same in one line; empty if there are none."""
    if not trials.reasons.trials:
        return ""
    more = trials.reasons.kinds - 1
    others = f" (and {more} other {'reason' if more == 1 else 'reasons'}: see the report)" if more else ""
    return f"{_how_many(trials)}. {trials.reasons.most(1)[0]}{others}"


def said(value: Any) -> str:
    """A value of a varied field."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _how_many(trials: Trials) -> str:
    return f"{trials.reasons.trials} of {trials.study.trials} trials were refused or stopped"


def _table_of_cells(trials: Trials) -> str:
    """A row a point, a column an observer."""
    study = trials.study
    fields = [axis.field for axis in study.axes]
    rows = []
    first = itertools.islice(cells_of(trials), MOST_ROWS * len(study.observers))
    for number, of in itertools.groupby(first, key=lambda row: row["point"]):
        point = study.points[number]
        rows.append([*(said(point[field]) for field in fields), *(_cell(row) for row in of)])
    table = markdown.table([*fields, *study.observers], rows, text_columns=0)
    more = len(study.points) - MOST_ROWS
    return table if more <= 0 else f"{table}\n\n{more} points more are in {CELLS}."


def _cell(row: dict[str, Any]) -> str:
    fell = f" [{row['fell']} fell]" if row["fell"] else ""
    stopped = f" [{row['stopped']} stopped]" if row["stopped"] else ""
    return format_figure(ERROR, row[ERROR]) + fell + stopped


def _values(axis: VariedField) -> str:
    if axis.is_range:
        return f"{said(axis.low)} to {said(axis.high)}{', evenly in the logarithm' if axis.log else ''}"
    values = [said(value) for value in axis.values]
    if len(values) <= MOST_VALUES:
        return ", ".join(values)
    return f"{', '.join(values[: MOST_VALUES - 1])}, ..., {values[-1]} ({len(values)} values)"


def _over_points(trials: Trials) -> str:
    """A row an observer: its error's mean and quantiles over the points, and its falls."""
    study = trials.study
    error, (fell, known) = trials.figure(ERROR), fall_counts(trials)
    table = []
    for place, name in enumerate(study.observers):
        means = _means(error[:, place])
        quantiles = np.quantile(means, QUANTILES) if len(means) else [math.nan] * len(QUANTILES)
        average = float(means.mean()) if len(means) else math.nan
        figures = [format_figure(ERROR, None if math.isnan(value) else value) for value in (average, *quantiles)]
        falls, of = int(fell[:, place].sum()), int(known[:, place].sum())
        share = f" ({100.0 * falls / of:.1f} %)" if of else ""
        table.append([name, f"{len(means)} of {len(study.points)}", *figures, f"{falls} of {of}{share}"])
    shares = ["median" if share == 0.5 else f"{100.0 * share:.0f} % quantile" for share in QUANTILES]
    return "\n\n".join(
        [
            f"{heading(ERROR)[0].upper()}{heading(ERROR)[1:]} of a point: the mean over its worlds that stood, so that "
            "where some fell it is that of the easier ones. Over the points at which any stood:",
            markdown.table(["observer", "points", "mean", *shares, "worlds that fell"], table),
            f"Every point is in {CELLS}.",
        ]
    )


def _means(values: np.ndarray) -> np.ndarray:
    """Means over the known worlds, of the points that have any, (n_points, n_worlds) -> (n_known,)."""
    known = np.isfinite(values)
    some = known.any(axis=1)
    return np.where(known, values, 0.0)[some].sum(axis=1) / known[some].sum(axis=1)
