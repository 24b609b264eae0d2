"""Pictures of a sweep: curves over one varied field, maps of the best observer over two."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.errors import counted
from cmg_mj.features.sweeps.cells import Trials, baselines_ahead, fall_shares, least, least_error, with_ends
from cmg_mj.features.sweeps.study import VariedField
from cmg_mj.results.summary_keys import heading
from cmg_mj.view.plots.figure import pyplot, scale_of
from cmg_mj.view.plots.style import colours, hexadecimal

ERRORS = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s")
"""Figures that are drawn where a trial has them; tables show the first."""
CURVES, FALLS = "curves", "map_falls"
MAPS = {ERRORS[0]: "map_velocity_error", ERRORS[1]: "map_push_error"}
"""Figure -> its map."""
TRUE_RATE = "true"
"""Name of the true rate in the loop, as baselines' trials have it, in a map."""
COLUMNS, MAX_TICKS = 3, 6
"""Panels of a map beside each other; marked values of an axis."""
MAX_NUMBERS = 8
"""Cells of a row or column up to which a map's cells have their numbers."""
LABEL = {"facecolor": "w", "alpha": 0.6, "edgecolor": "none", "pad": 1.0}
NOBODY, EMPTY = "none, or several alike", (232, 232, 232)
"""Name and colour of a cell without a best."""


class Picture(NamedTuple):
    """One picture.

    Attributes:
        name: Name of the file, without its ending.
        title: Its title.
        draw: Makes matplotlib's figure.
    """

    name: str
    title: str
    draw: Callable[[], Any]


@dataclass(frozen=True)
class Map:
    """The best observer over the values of two fields, all (n_y, n_x), and the figure that it is the best in.

    Attributes:
        label: The figure, in words.
        best: Place in the study's observers of each cell's best; negative for none.
        sure: Whether a cell's best is the best beyond chance; the other cells have a dot.
        each: Observer or baseline -> its own figure.
        ahead: Baseline -> a share, above one half where it has less error than the best.
        falls: Observer, or the true rate -> its share of falls.
    """

    label: str
    best: np.ndarray
    sure: np.ndarray
    each: Mapping[str, np.ndarray]
    ahead: Mapping[str, np.ndarray]
    falls: Mapping[str, np.ndarray]


def pictures_of(trials: Trials) -> list[Picture]:
    """Draw curves over one varied numeric field, a map a figure over two in a grid; else nothing."""
    study = trials.study
    axes = [axis for axis in study.axes if not axis.values or len(axis.values) > 1]  # a range has no values
    worlds = f"{counted(study.worlds, 'world')} a cell"
    title = f"{study.scenario.title or 'Sweep'}: "
    if not all(type(value) in (int, float) for axis in axes for value in axis.values):
        return []
    if len(axes) == 1 and (trials.stood | trials.fell).any():
        return [Picture(CURVES, title + worlds, partial(curves, trials, axes[0].field))]
    if len(axes) == 2 and study.sample is None:
        across, up = axes
        return [
            Picture(name, f"{title}{a_map.label}, {worlds}", partial(draw_map, a_map, study.observers, across, up))
            for name, a_map in maps(trials, across, up).items()
        ]
    return []


def curves(trials: Trials, field: str) -> Any:
    """Draw a panel a figure, and one of the share of falls if there are any, over the values of a field."""
    study = trials.study
    x = np.array([study.point(number)[field] for number in range(study.n_points)], dtype=float)
    order = np.argsort(x, kind="stable")
    keys = [key for key in ERRORS if np.isfinite(trials.figures[key]).any()]
    n = len(keys) + bool(trials.fell.any())
    figure, grid = pyplot().subplots(n, sharex=True, squeeze=False, layout="constrained", figsize=(9.0, 0.8 + 2.9 * n))
    palette, falls = colours(study.observers), np.insert(fall_shares(trials), 3, 0.0, axis=2)
    for axes, key in zip(grid[:, 0], [*keys, FALLS], strict=False):
        for place, name in enumerate(study.observers):
            curve = falls[:, place] if key == FALLS else error_curve(trials.figures[key][:, place])
            mean, low, high, is_part = curve[order].T
            color = hexadecimal(palette[name])
            axes.errorbar(x[order], mean, [mean - low, high - mean], fmt=".-", color=color, label=name)
            axes.plot(x[order][is_part == 1], mean[is_part == 1], "x", color=color, markersize=9)
        axes.set_ylabel("share of falls" if key == FALLS else heading(key))
        if key != FALLS and scale_of(trials.figures[key]) == "log":
            axes.set_yscale("log")
    grid[-1, 0].set(xlabel=field, xscale=scale_of(x))
    grid[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False)
    return figure


def error_curve(worlds: np.ndarray) -> np.ndarray:
    """Compute a figure's mean, the ends of its interval, and whether only some worlds have it, (n_points, 4)."""
    known = np.isfinite(worlds).sum(axis=1)
    ends = [list(with_ends("", point, positive=True).values()) for point in worlds]
    return np.column_stack([np.array(ends, dtype=float), (known > 0) & (known < worlds.shape[1])])


def maps(trials: Trials, across: VariedField, up: VariedField) -> dict[str, Map]:
    """Make a map a figure, by its picture's name, and one of the share of falls if there are any."""
    study, places = trials.study, trials.study.contenders
    x_order, y_order = np.argsort(across.values), np.argsort(up.values)

    def gridded(points: np.ndarray) -> np.ndarray:
        """Reshape (n_points, ...) to (n_y, n_x, ...), rising; points go through the second field first."""
        grid = points.reshape(len(x_order), len(y_order), *points.shape[1:])
        return grid.swapaxes(0, 1)[y_order][:, x_order]

    intervals = gridded(fall_shares(trials))
    shares = intervals[..., 0]
    falls = {study.observers[place]: shares[:, :, place] for place in places}
    if study.references:
        falls[TRUE_RATE] = shares[:, :, study.observers.index(study.references[0])]
    found = {}
    for key, name in MAPS.items():
        figure = gridded(trials.figures[key])
        if np.isfinite(figure).any():
            best, sure, value = least_error(figure, places)
            each = dict(zip(study.observers, np.moveaxis(figure.mean(axis=-1), -1, 0), strict=True))
            found[name] = Map(heading(key), best, sure, each, baselines_ahead(study, figure, value), falls)
    if trials.fell.any():
        best, value = least(shares, places)
        best[(shares[:, :, places] == value[..., None]).sum(axis=2) > 1] = -1  # several alike
        high = np.take_along_axis(intervals[..., 2], best[..., None], axis=2)
        only = (intervals[:, :, places, 1] <= high).sum(axis=2) == 1  # the best itself
        found[FALLS] = Map("share of falls", best, (best >= 0) & only, falls, {}, falls)
    return found


def draw_map(a_map: Map, observers: Sequence[str], across: VariedField, up: VariedField) -> Any:
    """Draw a panel of the best observer of every cell, and one of each one's own figure; a value takes a step."""
    n = 1 + len(a_map.each)
    columns = min(COLUMNS, n)
    size = (3.4 * columns + 2.0, 1.2 + 3.0 * -(-n // columns))
    figure, grid = pyplot().subplots(
        -(-n // columns), columns, sharex=True, sharey=True, squeeze=False, layout="constrained", figsize=size
    )
    best, *others = grid.flat
    for axes in others[n - 1 :]:
        axes.set_visible(False)
    image = {"origin": "lower", "aspect": "auto"}
    palette = {**colours([*observers, *a_map.falls, *a_map.ahead]), NOBODY: EMPTY}
    color = {name: hexadecimal(rgb) for name, rgb in palette.items()}
    kinds = [*observers, NOBODY]
    best.imshow(np.array([palette[kind] for kind in kinds], dtype=np.uint8)[a_map.best], **image)  # -1 is the last
    best.set_title("the best")
    handles = [
        best.plot([], [], "s", color=color[kind], label=kind)[0]
        for place, kind in zip((*range(len(observers)), -1), kinds, strict=True)
        if (a_map.best == place).any()
    ]
    rows, steps = np.nonzero((a_map.best >= 0) & ~a_map.sure)
    handles += best.plot(steps, rows, "o", color="0.1", markersize=3.5, label="not beyond chance")
    half, ahead = "{}: half of the worlds fall", "{}: less error than the best"
    for style, shares, label in (("--", a_map.falls, half), (":", a_map.ahead, ahead)):
        for name, share in shares.items():
            if (share < 0.5).any() and (share > 0.5).any():
                edges = [[-0.5, *range(size), size - 0.5] for size in share.shape]  # to the map's border
                wide = np.ma.masked_invalid(np.pad(share, 1, mode="edge"))
                best.contour(edges[1], edges[0], wide, [0.5], colors=color[name], linestyles=style)
                handles += best.plot([], [], style, color=color[name], label=label.format(name))
    values = np.stack(list(a_map.each.values()))
    known = values[np.isfinite(values)]
    limits = {"vmin": known.min(), "vmax": known.max(), "norm": scale_of(values)} if len(known) else {}
    for axes, (name, own) in zip(others, a_map.each.items(), strict=False):
        axes.imshow(np.ma.masked_invalid(own), **image, **limits)
        axes.set_title(name)
        for (row, step), value in np.ndenumerate(own) if max(own.shape) <= MAX_NUMBERS else ():
            if math.isfinite(value):
                axes.text(step, row, f"{value:.3g}", ha="center", va="center", fontsize=7, color="0.1", bbox=LABEL)
    figure.colorbar(others[0].images[0], ax=grid, label=a_map.label)
    for axis, varied in ((best.xaxis, across), (best.yaxis, up)):
        marks = sorted(varied.values)
        step = -(-len(marks) // MAX_TICKS)
        axis.set_ticks(range(0, len(marks), step), [f"{mark:g}" for mark in marks[::step]])
    for axes in grid.flat:
        axes.tick_params(labelbottom=True)  # a hidden panel below would take the labels with it
    best.set_xlabel(across.field)
    best.set_ylabel(up.field)
    figure.legend(handles=handles, loc="outside lower right", ncols=3)
    return figure
