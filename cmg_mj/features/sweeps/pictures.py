"""Pictures of a sweep: curves over one varied field, maps of the best observer over two."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np

from cmg_mj.features.sweeps.cells import Trials, baselines_ahead, fell_interval, least_error, smallest
from cmg_mj.features.sweeps.study import counted, is_number
from cmg_mj.results.intervals import Interval, finite_mean, known_interval
from cmg_mj.results.summary_keys import heading
from cmg_mj.view.plots.figure import Line, Panel, Picture
from cmg_mj.view.plots.map_plot import Map, Surface
from cmg_mj.view.plots.style import short_names

ERRORS = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s")
"""Figures that are drawn, and whose indices are shown, where a trial has them; tables show the first."""
MOST_TICKS, FEW_TICKS = 10, 4
COLUMNS = 4
"""Small panels, one an observer, in a row below a map."""
CURVES = "curves"
LOGARITHMIC = 10.0
"""Errors that differ by more than this factor are drawn on a logarithmic axis."""
ASIDE = 0.3
"""Share of the smallest step between values over which the observers' shares of falls are spread."""
TRUE_RATE = "true"
"""Name of the true rate in the loop, as baselines' trials have it, in a map."""
UNKNOWN = Interval(math.nan, math.nan, math.nan)
SECTIONS = ("plant", "controller", "observer", "sensors", "axes", "metrics")
"""Sections of a scenario that add nothing to a field's name."""
UNITS = {
    "_ug_rthz": "ug/rtHz",
    "_deg_s_rthz": "deg/s/rtHz",
    "_deg_s": "deg/s",
    "_rad_s": "rad/s",
    "_kg_m2": "kg m^2",
    "_n_m_s_rad": "N m s/rad",
    "_n_m_rad": "N m/rad",
    "_n_m_s": "N m s/rad",
    "_n_m": "N m",
    "_m_s2": "m/s^2",
    "_arcmin": "arcmin",
    "_deg": "deg",
    "_hz": "Hz",
    "_mm": "mm",
    "_mg": "mg",
    "_ms": "ms",
    "_kg": "kg",
    "_m": "m",
    "_s": "s",
}
"""The end of a field's name -> its unit; the first that fits."""
MAPS = {ERRORS[0]: "map_velocity_error", ERRORS[1]: "map_push_error", "fell": "map_falls"}
"""Figure -> its picture."""


def pictures_of(trials: Trials) -> list[Picture]:
    """Draw curves over one varied numeric field, a map a figure over two in a grid; else nothing."""
    study = trials.study
    axes = [axis for axis in study.axes if axis.is_range or len(axis.values) > 1]
    if not all(is_number(value) for axis in axes for value in axis.values):
        return []
    if len(axes) == 1 and study.design != "sobol":
        pictures = [curves(trials, axes[0].field)]
    elif len(axes) == 2 and study.design == "grid":
        pictures = maps(trials, axes[0].field, axes[1].field)
    else:
        return []
    return [picture for picture in pictures if picture.panels]


def curves(trials: Trials, field: str) -> Picture:
    """Draw a panel a figure, and one of the share of falls if there are any, over the values of a field."""
    study = trials.study
    x = np.array([point[field] for point in study.points], dtype=float)
    order = np.argsort(x, kind="stable")
    x = x[order]
    scale = scale_of(trials, field, x)
    panel = partial(
        Panel,
        x_label=in_words(field),
        x_scale=scale,
        x_ticks=ticks_of(x) if study.design == "grid" else None,
    )
    panels = []
    for key in ERRORS:
        values = trials.figure(key)[order]
        if np.isfinite(values).any():
            lines = _error_lines(study.observers, x, values)
            y = np.concatenate([line.y for line in lines])
            is_log = np.nanmin(y) > 0.0 and np.nanmax(y) > LOGARITHMIC * np.nanmin(y)
            of_log = {"y_scale": "log", "y_ticks": round_values(y)} if is_log else {}
            panels.append(panel(heading(key), lines, **of_log))
    if trials.fell.any():
        lines = _fall_lines(trials, x, order, scale)
        panels.append(panel("share of falls", lines, y_range=(-0.03, 1.03)))
    if panels:
        n = len(study.observers)
        labelled = [replace(line, label=name) for line, name in zip(panels[0].lines[:n], study.observers, strict=True)]
        panels[0] = replace(panels[0], lines=[*labelled, *panels[0].lines[n:]])
    return Picture(CURVES, title_of(trials), panels, panel_height=2.9)


def _error_lines(observers: Sequence[str], x: np.ndarray, values: np.ndarray) -> list[Line]:
    """Make a line an observer, then its marks, of values (n_points, n_observers, n_worlds).

    A mark is a dot where every world stood, a cross where only some did.
    """
    lines, marks = [], []
    for place, name in enumerate(observers):
        worlds = values[:, place]
        intervals = [known_interval(point, positive=True) or Interval(*[_mean(point)] * 3) for point in worlds]
        mean = np.array([interval.mean for interval in intervals])
        lines.append(Line(x, mean, color=name, spread=_heights(intervals)))
        whole = np.isfinite(worlds).all(axis=1)
        for mark, where in ((".", whole), ("x", np.isfinite(mean) & ~whole)):
            if where.any():
                marks.append(Line(x[where], mean[where], style=mark, color=name))
    return lines + marks


def _mean(worlds: np.ndarray) -> float:
    """Average the worlds that stood, too few for an interval, if one did."""
    mean = finite_mean(worlds)
    return math.nan if mean is None else mean


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


def maps(trials: Trials, across: str, up: str) -> list[Picture]:
    """Draw a map a figure, and one of the share of falls if there are any; both fields in a grid."""
    study = trials.study
    values = {axis.field: np.array(axis.values, dtype=float) for axis in study.axes if axis.field in (across, up)}
    x_order, y_order = np.argsort(values[across]), np.argsort(values[up])
    x, y = values[across][x_order], values[up][y_order]

    def gridded(points: np.ndarray) -> np.ndarray:
        """Reshape (n_points, ...) to (n_y, n_x, ...); points go through the second field first."""
        return points.reshape(len(x), len(y), *points.shape[1:]).swapaxes(0, 1)[y_order][:, x_order]

    fell, known = (gridded(counts) for counts in fall_counts(trials))
    shares = fall_shares(fell, known)
    places = study.contenders
    halves = {study.observers[place]: shares[:, :, place] for place in places}
    if study.references:
        halves[TRUE_RATE] = shares[:, :, study.observers.index(study.references[0])]
    boundaries = {name: half for name, half in halves.items() if (half < 0.5).any() and (half > 0.5).any()}
    scales = {"x_scale": scale_of(trials, across, x), "y_scale": scale_of(trials, up, y)}

    def panel(ticks: int, **parts: Any) -> Panel:
        x_ticks, y_ticks = ticks_of(x, ticks), ticks_of(y, ticks)
        return Panel(in_words(up), (), x_label=in_words(across), x_ticks=x_ticks, y_ticks=y_ticks, **scales, **parts)

    pictures = []
    for key, name in MAPS.items():
        if key == "fell":
            if not trials.fell.any():
                continue
            best, sure, least = _least_falls(fell, known, places)
            ahead = {}
            alone = {study.observers[place]: shares[:, :, place] for place in places}
            if study.references:
                alone[TRUE_RATE] = halves[TRUE_RATE]
            label, value, levels, nobody = "share of falls", "share of falls", (0.1, 0.9), "several alike"
        else:
            figure = gridded(trials.figure(key))
            if not np.isfinite(figure).any():
                continue
            best, sure, least = least_error(figure, places)
            ahead = baselines_ahead(study, figure, least)
            alone = {name: figure[:, :, place].mean(axis=-1) for place, name in enumerate(study.observers)}
            label, value, levels, nobody = heading(key), "mean error", round_values(least), "none stood in every world"
        half = "half of the worlds fall"
        cells = Map(x, y, study.observers, best, sure, least, levels, boundaries, nobody, half, ahead)
        surfaces = _surfaces(x, y, alone, label, (0.5,) if key == "fell" else None)
        titles = short_names(list(surfaces))
        best_of = panel(MOST_TICKS, title=f"Best observer, by colour; thin lines: its {value}", map=cells)
        each = [panel(FEW_TICKS, title=titles[name], surface=surface) for name, surface in surfaces.items()]
        columns = min(COLUMNS, len(each))
        pictures.append(
            Picture(
                name,
                title_of(trials, label),
                [best_of, *each],
                columns=columns,
                panel_height=2.1,
                panel_width=10.4 / columns,
                first_height=4.7,
            )
        )
    return pictures


def _surfaces(
    x: np.ndarray, y: np.ndarray, alone: Mapping[str, np.ndarray], label: str, levels: Sequence[float] | None
) -> dict[str, Surface]:
    """Make a surface an observer of values (n_y, n_x), all on one scale of colours; None for round levels."""
    values = np.stack(list(alone.values()))
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    scale: Literal["linear", "log"] = "log" if 0.0 < LOGARITHMIC * low < high else "linear"
    levels = round_values(known) if levels is None else levels
    limits = (low, high) if low < high else (low - 0.5, high + 0.5)
    return {name: Surface(x, y, own, label, limits, scale, levels) for name, own in alone.items()}


def in_words(field: str) -> str:
    """Name a scenario's field in words, with its unit: `push.0.torque_n_m` is `push torque [N m]`."""
    *sections, name = field.split(".")
    unit = ""
    for ending, written in UNITS.items():
        if name.endswith(ending):
            name, unit = name.removesuffix(ending), f" [{written}]"
            break
    kept = [part for part in sections if part not in SECTIONS and part != "0"]
    parts = [str(int(part) + 1) if part.isdigit() else part for part in kept]
    return " ".join([*parts, *name.split("_")]) + unit


def _least_falls(fell: np.ndarray, known: np.ndarray, places: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find who of some falls the least, unless several do, (n_y, n_x, n_observers) -> (n_y, n_x) each.

    The best is sure if its Wilson interval is below those of all others.
    """
    shares = np.full(fell.shape, math.nan)
    shares[:, :, places] = fall_shares(fell, known)[:, :, places]
    best, least = smallest(shares)
    best[(shares == least[:, :, None]).sum(axis=2) > 1] = -1
    sure = np.zeros(best.shape, dtype=bool)
    for at in zip(*np.nonzero(best >= 0), strict=True):
        pairs = zip(fell[at][places], known[at][places], strict=True)
        intervals = [fell_interval(n, trials) for n, trials in pairs if trials]
        low = sorted(intervals, key=lambda interval: interval.mean)
        sure[at] = all(low[0].high < other.low for other in low[1:])
    return best, sure, least


def is_logarithmic(values: Sequence[float] | np.ndarray) -> bool:
    """Judge whether values are spaced more evenly in their logarithm, such as 100, 200, 500, 1000."""
    sorted_values = np.unique(np.asarray(values, dtype=float))
    if len(sorted_values) < 3 or sorted_values[0] <= 0.0:
        return False
    steps, ratios = np.diff(sorted_values), np.diff(np.log(sorted_values))
    return bool(ratios.max() / ratios.min() < steps.max() / steps.min() * (1.0 - 1e-9))


def scale_of(trials: Trials, field: str, values: np.ndarray) -> Literal["linear", "log"]:
    """Choose the scale of a varied field's axis."""
    axis = next(axis for axis in trials.study.axes if axis.field == field)
    return "log" if (axis.log if axis.is_range else is_logarithmic(values)) else "linear"


def ticks_of(values: np.ndarray, most: int = MOST_TICKS) -> list[float]:
    """Choose values to mark, not too many."""
    return [float(value) for value in values[:: math.ceil(len(values) / most)]]


def round_values(values: np.ndarray) -> tuple[float, ...]:
    """Choose at most seven round numbers between the least and the greatest value; none if they are too alike."""
    known = values[np.isfinite(values) & (values > 0.0)]
    if not len(known) or known.min() == known.max():
        return ()
    low, high = float(known.min()), float(known.max())
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    levels: list[float] = []
    for marks in ((10, 20, 50), (10, 15, 20, 30, 50, 70), range(10, 100, 5), range(10, 100), range(100, 1000, 2)):
        scale = 100.0 if marks[0] == 100 else 10.0
        levels = [float(f"{mark / scale * 10.0**decade:.4g}") for decade in decades for mark in marks]
        levels = [level for level in levels if low < level < high]
        if len(levels) >= 3:
            break
    return tuple(levels[:: math.ceil(len(levels) / 7)]) if levels else ()


def fall_counts(trials: Trials) -> tuple[np.ndarray, np.ndarray]:
    """Count the worlds that fell, and those that fell or stood, (n_points, n_observers) each."""
    fell = trials.fell
    return fell.sum(axis=2), (fell | trials.stood).sum(axis=2)


def fall_shares(fell: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Compute shares of falls from such counts; NaN where every world was refused or stopped, which says neither."""
    return np.divide(fell, known, out=np.full(fell.shape, math.nan), where=known > 0)


def title_of(trials: Trials, figure: str = "") -> str:
    """Title a picture with the scenario, the figure that it shows and the number of worlds."""
    study = trials.study
    worlds = f"{counted(study.worlds, 'world')} a cell"
    return f"{study.scenario.title or 'Sweep'}: {f'{figure}, {worlds}' if figure else worlds}"
