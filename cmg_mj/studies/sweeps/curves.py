"""Curves of a sweep over one varied field, an observer a line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np

from cmg_mj.results.intervals import Interval, known_interval
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
"""Of the smallest step between values, over which observers' shares of falls stand beside each other."""
UNKNOWN = Interval(math.nan, math.nan, math.nan)


def curves(trials: Trials, field: str) -> Picture:
    """A panel a figure, and one of the share of falls if there are any, over the values of a field."""
    study = trials.study
    x = np.array([float(point[field]) for point in study.points])
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
            drawn = np.concatenate([line.y for line in lines])
            far = np.nanmin(drawn) > 0.0 and np.nanmax(drawn) > LOGARITHMIC * np.nanmin(drawn)
            more: dict[str, Any] = {"y_scale": "log", "y_ticks": round_values(drawn)} if far else {}
            panels.append(panel(heading(key), lines, **more))
    if trials.fell.any():
        lines = _fall_lines(trials, x, order, scale)
        panels.append(panel("share of falls", lines, y_range=(-0.03, 1.03)))
    names = [*study.observers, *([""] * len(panels[0].lines))] if panels else []
    labelled = [replace(line, label=name) for line, name in zip(panels[0].lines, names, strict=False)] if panels else []
    panels[:1] = [replace(first, lines=labelled) for first in panels[:1]]
    return Picture(CURVES, title_of(trials), panels, panel_height=2.9)


def _error_lines(observers: Sequence[str], x: np.ndarray, values: np.ndarray) -> list[Line]:
    """A line an observer, then its marks, of values (n_points, n_observers, n_worlds).

    A dot where every world stood, a cross where only some did.
    """
    lines, marks = [], []
    for place, name in enumerate(observers):
        of = values[:, place]
        found = [known_interval(worlds) or _alone(worlds) for worlds in of]
        mean = np.array([interval.mean for interval in found])
        lines.append(Line(x, mean, color=name, spread=_around(found)))
        whole = np.isfinite(of).all(axis=1)
        for mark, where in ((".", whole), ("x", np.isfinite(mean) & ~whole)):
            if where.any():
                marks.append(Line(x[where], mean[where], style=mark, color=name))
    return lines + marks


def _alone(worlds: np.ndarray) -> Interval:
    """Of one world, or none, that stood."""
    stood = worlds[np.isfinite(worlds)]
    mean = float(stood[0]) if len(stood) else math.nan
    return Interval(mean, mean, mean)


def _around(found: Sequence[Interval]) -> np.ndarray:
    return np.array([[of.mean - of.low for of in found], [of.high - of.mean for of in found]])


def _fall_lines(trials: Trials, x: np.ndarray, order: np.ndarray, scale: Literal["linear", "log"]) -> list[Line]:
    """A line an observer over x, of points in that order; beside each other, as many are 0 or 1 together."""
    counts = [found[order] for found in fall_counts(trials)]
    shares = fall_shares(*counts)
    lines = []
    on_axis = np.log(x) if scale == "log" else x
    step = np.diff(on_axis).min(initial=math.inf)
    for place, name in enumerate(trials.study.observers):
        aside = ASIDE * (step if math.isfinite(step) else 0.0) * (place / max(1, len(trials.study.observers) - 1) - 0.5)
        at = np.exp(on_axis + aside) if scale == "log" else on_axis + aside
        found = [
            fell_interval(fell, of) if of else UNKNOWN for fell, of in zip(*(n[:, place] for n in counts), strict=True)
        ]
        lines.append(Line(at, shares[:, place], style=".-", color=name, spread=_around(found), bars=True))
    return lines
