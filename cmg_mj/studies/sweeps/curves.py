"""Curves of a sweep over one varied field, a line an observer."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from cmg_mj.results.intervals import Interval, finite_values, known_interval
from cmg_mj.results.summary_keys import heading
from cmg_mj.studies.sweeps.cells import Trials, fell_interval
from cmg_mj.studies.sweeps.plot_scales import (
    ERRORS,
    fall_counts,
    fall_shares,
    round_values,
    scale_of,
    ticks_of,
    title_of,
)
from cmg_mj.visualization.plots.figure_spec import Line, Panel, Picture

CURVES = "curves"
LOGARITHMIC = 10.0
"""Errors that differ by more than this factor are drawn on a logarithmic axis."""
ASIDE = 0.3
"""Share of the smallest step between values over which the observers' shares of falls are spread."""
UNKNOWN = Interval(math.nan, math.nan, math.nan)


def curves(trials: Trials, field: str) -> Picture:
    """Draw a panel a figure, and one of the share of falls if there are any, over the values of a field."""
    study = trials.study
    x = np.array([point[field] for point in study.points], dtype=float)
    order = np.argsort(x, kind="stable")
    x = x[order]
    scale = scale_of(trials, field, x)
    panel = partial(
        Panel,
        x_label=field,
        x_scale=scale,
        x_ticks=ticks_of(x) if study.design == "grid" else None,
    )
    panels = []
    for key in ERRORS:
        values = trials.figure(key)[order]
        if np.isfinite(values).any():
            lines = _error_lines(study.observers, x, values)
            y = np.concatenate([line.y for line in lines])
            if np.nanmin(y) > 0.0 and np.nanmax(y) > LOGARITHMIC * np.nanmin(y):
                panels.append(panel(heading(key), lines, y_scale="log", y_ticks=round_values(y)))
            else:
                panels.append(panel(heading(key), lines))
    if trials.fell.any():
        lines = _fall_lines(trials, x, order, scale)
        panels.append(panel("share of falls", lines, y_range=(-0.03, 1.03)))
    if panels:
        names = itertools.chain(study.observers, itertools.repeat(""))
        labelled = [replace(line, label=name) for line, name in zip(panels[0].lines, names, strict=False)]
        panels[0] = replace(panels[0], lines=labelled)
    return Picture(CURVES, title_of(trials), panels, panel_height=2.9)


def _error_lines(observers: Sequence[str], x: np.ndarray, values: np.ndarray) -> list[Line]:
    """Make a line an observer, then its marks, of values (n_points, n_observers, n_worlds).

    A mark is a dot where every world stood, a cross where only some did.
    """
    lines, marks = [], []
    for place, name in enumerate(observers):
        worlds = values[:, place]
        intervals = [known_interval(point) or _without_interval(point) for point in worlds]
        mean = np.array([interval.mean for interval in intervals])
        lines.append(Line(x, mean, color=name, spread=_heights(intervals)))
        whole = np.isfinite(worlds).all(axis=1)
        for mark, where in ((".", whole), ("x", np.isfinite(mean) & ~whole)):
            if where.any():
                marks.append(Line(x[where], mean[where], style=mark, color=name))
    return lines + marks


def _without_interval(worlds: np.ndarray) -> Interval:
    """Take the only world that stood, if one did, for the mean."""
    stood = finite_values(worlds)
    mean = float(stood[0]) if len(stood) else math.nan
    return Interval(mean, mean, mean)


def _heights(intervals: Sequence[Interval]) -> np.ndarray:
    """Stack the intervals' heights below and above the mean, (2, n)."""
    return np.array([[i.mean - i.low for i in intervals], [i.high - i.mean for i in intervals]])


def _fall_lines(trials: Trials, x: np.ndarray, order: np.ndarray, scale: Literal["linear", "log"]) -> list[Line]:
    """Make a line an observer over x, of points in that order, next to each other: many are 0 or 1 together."""
    counts = [count[order] for count in fall_counts(trials)]
    shares = fall_shares(*counts)
    lines = []
    on_axis = np.log(x) if scale == "log" else x
    step = np.diff(on_axis).min(initial=math.inf)
    for place, name in enumerate(trials.study.observers):
        aside = ASIDE * (step if math.isfinite(step) else 0.0) * (place / max(1, len(trials.study.observers) - 1) - 0.5)
        at = np.exp(on_axis + aside) if scale == "log" else on_axis + aside
        pairs = zip(*(count[:, place] for count in counts), strict=True)
        intervals = [fell_interval(fell, known) if known else UNKNOWN for fell, known in pairs]
        lines.append(Line(at, shares[:, place], style=".-", color=name, spread=_heights(intervals), bars=True))
    return lines
