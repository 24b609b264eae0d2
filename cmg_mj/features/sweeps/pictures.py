"""Pictures of a sweep: curves over one varied field, maps of the best observer over two."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from cmg_mj.features.sweeps.cells import Trials, baselines_ahead, fell_interval, least, least_error, with_ends
from cmg_mj.features.sweeps.study import VariedField, counted
from cmg_mj.results.summary_keys import heading
from cmg_mj.view.plots.figure import pyplot
from cmg_mj.view.plots.style import colours, hexadecimal, short_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ERRORS = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s")
"""Figures that are drawn, and whose indices are shown, where a trial has them; tables show the first."""
CURVES, FALLS = "curves", "map_falls"
MAPS = {ERRORS[0]: "map_velocity_error", ERRORS[1]: "map_push_error"}
"""Figure -> its map."""
TRUE_RATE = "true"
"""Name of the true rate in the loop, as baselines' trials have it, in a map."""
COLUMNS, MAX_TICKS = 4, 10
"""Small panels, one an observer, in a row below a map; marked values of an axis."""
EMPTY = (232, 232, 232)
"""Colour of a cell without a best."""
UNKNOWN = (math.nan, math.nan, math.nan)
LOGARITHMIC = 10.0
"""Values that differ by more than this factor have a logarithmic scale."""


class Picture(NamedTuple):
    """One picture.

    Attributes:
        name: Name of the file, without its ending.
        title: Its title.
        draw: Makes the figure.
    """

    name: str
    title: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Map:
    """The best observer over the values of two fields, all (n_y, n_x), and the figure that it is the best in.

    Attributes:
        label: The figure, in words.
        best: Place in the study's observers of each cell's best; negative for none.
        sure: Whether a cell's best is the best beyond chance; the other cells have a dot.
        value: The best's figure; NaN for none.
        each: Observer or baseline -> its own figure.
        ahead: Baseline -> a share, above one half where it has less error than the best.
        falls: Observer, or the true rate -> its share of falls.
    """

    label: str
    best: np.ndarray
    sure: np.ndarray
    value: np.ndarray
    each: Mapping[str, np.ndarray]
    ahead: Mapping[str, np.ndarray]
    falls: Mapping[str, np.ndarray]


def pictures_of(trials: Trials) -> list[Picture]:
    """Draw curves over one varied numeric field, a map a figure over two in a grid; else nothing."""
    study = trials.study
    axes = [axis for axis in study.axes if len(axis.values) != 1]
    worlds = f"{counted(study.worlds, 'world')} a cell"
    title = f"{study.scenario.title or 'Sweep'}: "
    if any(isinstance(value, bool) or not isinstance(value, (int, float)) for axis in axes for value in axis.values):
        return []
    if len(axes) == 1 and study.design != "sobol" and (trials.stood | trials.fell).any():
        return [Picture(CURVES, title + worlds, partial(curves, trials, axes[0].field))]
    if len(axes) == 2 and study.design == "grid":
        across, up = axes
        return [
            Picture(name, f"{title}{a_map.label}, {worlds}", partial(draw_map, a_map, study.observers, across, up))
            for name, a_map in maps(trials, across, up).items()
        ]
    return []


def curves(trials: Trials, field: str) -> Figure:
    """Draw a panel a figure, and one of the share of falls if there are any, over the values of a field."""
    study = trials.study
    x = np.array([study.point(number)[field] for number in range(study.n_points)], dtype=float)
    order = np.argsort(x, kind="stable")
    keys = [key for key in ERRORS if np.isfinite(trials.figure(key)).any()]
    n = len(keys) + bool(trials.fell.any())
    figure, grid = pyplot().subplots(n, sharex=True, squeeze=False, layout="constrained", figsize=(9.0, 0.8 + 2.9 * n))
    palette = colours(study.observers)
    for axes, key in zip(grid[:, 0], [*keys, FALLS], strict=False):
        for place, name in enumerate(study.observers):
            curve = fall_curve(trials, place) if key == FALLS else error_curve(trials.figure(key)[:, place])
            mean, low, high, is_part = curve[order].T
            color = hexadecimal(palette[name])
            axes.errorbar(x[order], mean, [mean - low, high - mean], fmt=".-", color=color, label=name.lstrip("_"))
            axes.plot(x[order][is_part == 1], mean[is_part == 1], "x", color=color, markersize=9)
        axes.set_ylabel("share of falls" if key == FALLS else heading(key))
        if key != FALLS and scale_of(trials.figure(key)) == "log":
            axes.set_yscale("log")
    grid[-1, 0].set(xlabel=field, xscale=scale_of(x))
    grid[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False)
    return figure


def error_curve(worlds: np.ndarray) -> np.ndarray:
    """Compute a figure's mean, the ends of its interval, and whether only some worlds have it, (n_points, 4)."""
    known = np.isfinite(worlds).sum(axis=1)
    ends = [list(with_ends("", point, positive=True).values()) for point in worlds]
    return np.column_stack([np.array(ends, dtype=float), (known > 0) & (known < worlds.shape[1])])


def fall_curve(trials: Trials, place: int) -> np.ndarray:
    """Compute an observer's share of falls, the ends of its interval, and a column of 0, (n_points, 4)."""
    counts = zip(*(counts[:, place].tolist() for counts in fall_counts(trials)), strict=True)
    return np.array([(*(fell_interval(fell, known) if known else UNKNOWN), 0.0) for fell, known in counts])


def scale_of(values: np.ndarray) -> Literal["linear", "log"]:
    """Choose a logarithmic scale for positive values of more than one decade."""
    known = values[np.isfinite(values)]
    return "log" if 0.0 < LOGARITHMIC * known.min() < known.max() else "linear"


def maps(trials: Trials, across: VariedField, up: VariedField) -> dict[str, Map]:
    """Make a map a figure, by its picture's name, and one of the share of falls if there are any."""
    study, places = trials.study, trials.study.contenders
    x_order, y_order = np.argsort(across.values), np.argsort(up.values)

    def gridded(points: np.ndarray) -> np.ndarray:
        """Reshape (n_points, ...) to (n_y, n_x, ...), rising; points go through the second field first."""
        grid = points.reshape(len(x_order), len(y_order), *points.shape[1:])
        return grid.swapaxes(0, 1)[y_order][:, x_order]

    fell, known = (gridded(counts) for counts in fall_counts(trials))
    shares = np.divide(fell, known, out=np.full(fell.shape, math.nan), where=known > 0)
    falls = {study.observers[place]: shares[:, :, place] for place in places}
    if study.references:
        falls[TRUE_RATE] = shares[:, :, study.observers.index(study.references[0])]
    found = {}
    for key, name in MAPS.items():
        figure = gridded(trials.figure(key))
        if np.isfinite(figure).any():
            best, sure, value = least_error(figure, places)
            each = dict(zip(study.observers, np.moveaxis(figure.mean(axis=-1), -1, 0), strict=True))
            found[name] = Map(heading(key), best, sure, value, each, baselines_ahead(study, figure, value), falls)
    if trials.fell.any():
        best, value = least(shares, places)
        best[(shares[:, :, places] == value[:, :, None]).sum(axis=2) > 1] = -1  # several alike
        sure = np.zeros(best.shape, dtype=bool)
        for at in zip(*np.nonzero(best >= 0), strict=True):
            others = [
                fell_interval(int(fell[at][i]), int(known[at][i])) for i in places if i != best[at] and known[at][i]
            ]
            own = fell_interval(int(fell[at][best[at]]), int(known[at][best[at]]))
            sure[at] = all(own.high < other.low for other in others)
        found[FALLS] = Map("share of falls", best, sure, value, falls, {}, falls)
    return found


def draw_map(a_map: Map, observers: Sequence[str], across: VariedField, up: VariedField) -> Figure:
    """Draw the best observer of every cell, and below it a small panel of each one's own figure."""
    columns = min(COLUMNS, len(a_map.each))
    rows = -(-len(a_map.each) // columns)
    figure = pyplot().figure(figsize=(10.4, 5.5 + 2.1 * rows), layout="constrained")
    grid = figure.add_gridspec(2 + rows, columns)
    top = figure.add_subplot(grid[:2, :], title="Best observer, by colour; thin lines: its figure")
    _draw_best(top, a_map, observers)
    top.set(ylabel=up.field)
    below = [figure.add_subplot(grid[2 + i // columns, i % columns]) for i in range(len(a_map.each))]
    values = np.stack(list(a_map.each.values()))
    limits = {"vmin": np.nanmin(values), "vmax": np.nanmax(values)} if np.isfinite(values).any() else {}
    titles = short_names(list(a_map.each))
    for axes, (name, own) in zip(below, a_map.each.items(), strict=True):
        axes.imshow(np.ma.masked_invalid(own), origin="lower", aspect="auto", norm=scale_of(values), **limits)
        axes.set_title(titles[name], fontsize="medium")
    figure.colorbar(below[0].images[0], ax=below, label=a_map.label, location="bottom", aspect=60)
    for axes in (top, *below):
        for axis, varied in ((axes.xaxis, across), (axes.yaxis, up)):
            marks = sorted(varied.values)
            step = -(-len(marks) // MAX_TICKS)
            axis.set_ticks(range(0, len(marks), step), [f"{mark:g}" for mark in marks[::step]])
        axes.set(xlabel=across.field)
    return figure


def _draw_best(axes: Axes, a_map: Map, observers: Sequence[str]) -> None:
    palette = colours([*observers, *a_map.falls, *a_map.ahead])
    names, color = short_names(list(palette)), {name: hexadecimal(rgb) for name, rgb in palette.items()}
    cells = np.array([*(palette[name] for name in observers), EMPTY], dtype=np.uint8)  # -1 is the last

    def in_legend(style: str, label: str, **properties: Any) -> None:
        axes.plot([], [], style, label=label.lstrip("_"), **properties)  # matplotlib hides a leading underscore

    axes.imshow(cells[a_map.best], origin="lower", aspect="auto")
    for place, name in enumerate(observers):
        if (a_map.best == place).any():
            in_legend("s", names[name], color=color[name])
    if (a_map.best < 0).any():
        in_legend("s", "none, or several alike", color=hexadecimal(EMPTY))
    if len(np.unique(a_map.value[np.isfinite(a_map.value)])) > 1:
        axes.clabel(axes.contour(np.ma.masked_invalid(a_map.value), colors="0.1", linewidths=0.8), fontsize="small")
    unsure = (a_map.best >= 0) & ~a_map.sure
    if unsure.any():
        rows, columns = np.nonzero(unsure)
        axes.plot(columns, rows, "o", color="0.1", markersize=3.5, label="not beyond chance")
    half, ahead = "{}: half of the worlds fall", "{}: less error than the best"
    for style, shares, label in (("--", a_map.falls, half), (":", a_map.ahead, ahead)):
        for name, share in shares.items():
            if (share < 0.5).any() and (share > 0.5).any():
                axes.contour(np.ma.masked_invalid(share), [0.5], colors=color[name], linewidths=2.4, linestyles=style)
                in_legend(style, label.format(names[name]), color=color[name], linewidth=2.4)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize="small", frameon=False)


def fall_counts(trials: Trials) -> tuple[np.ndarray, np.ndarray]:
    """Count the worlds that fell, and those that fell or stood, (n_points, n_observers) each."""
    return trials.fell.sum(axis=2), (trials.fell | trials.stood).sum(axis=2)
