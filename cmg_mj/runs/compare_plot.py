"""A plot of the distribution of every figure of a comparison over the worlds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.results.intervals import known_interval
from cmg_mj.results.summary_keys import KEYS
from cmg_mj.runs.comparison import ComparedObserver, ComparisonRow, comparison_rows
from cmg_mj.view.plots.figure import pyplot, save_figure
from cmg_mj.view.plots.style import colours, hexadecimal, short_names

COLUMNS = 3
"""Panels in a row."""
LOGARITHMIC = 10.0
"""Positive figures that differ by more than this factor are drawn on a logarithmic axis."""


def plot_worlds(path: Path, compared: Sequence[ComparedObserver], title: str) -> None:
    """Draw a panel a figure, with the observers on one axis: every world, the mean and its 95 % interval.

    Worlds that did not stand to the end are crosses, at the figure until then; the mean is without them.

    Args:
        path: The PNG to write.
        compared: The observers with their runs.
        title: The scenario's title.
    """
    rows = comparison_rows(compared)
    values = {
        key: _Worlds([row.values(key) for row in rows], [_until_the_end(row, key) for row in rows]) for key in KEYS
    }
    drawn = [key for key in KEYS if KEYS[key].compared and np.isfinite(values[key].all).any()]
    down = -(-len(drawn) // COLUMNS)
    size = (12.0, 1.2 + down * (0.9 + 0.22 * len(rows)))
    figure, grid = pyplot().subplots(down, COLUMNS, sharey=True, figsize=size, layout="constrained", squeeze=False)
    for axes in grid.flat[len(drawn) :]:
        axes.set_visible(False)
    palette = [hexadecimal(colour) for colour in colours(row.name for row in rows).values()]
    for axes, key in zip(grid.flat, drawn, strict=False):
        _draw(axes, key, values[key], palette)
    first = grid.flat[0]
    names = short_names([row.name for row in rows])
    first.set_yticks(range(len(rows)), [_label(row, names[row.name]) for row in rows])
    first.invert_yaxis()  # shared: the table's order in every panel
    worlds = len(rows[0].entry.result.outcomes)
    heading = f"{title or 'Comparison'}: {worlds} worlds an observer. Lines: mean and its 95 % interval."
    if not all(row.entry.result.stood.all() for row in rows):
        heading += " Crosses: worlds that did not stand to the end, until then."
    save_figure(path, figure, heading, dpi=100)


def _label(row: ComparisonRow, name: str) -> str:
    """Label a row with its name and the number of worlds that did not stand."""
    lost = int((~row.entry.result.stood).sum())
    return f"{name} ({lost} lost)" if lost and not row.reference else name


class _Worlds(NamedTuple):
    """A figure of every world of every row: of those that stood, and until their end of the others."""

    stood: Sequence[np.ndarray]
    lost: Sequence[np.ndarray]

    @property
    def all(self) -> np.ndarray:
        return np.concatenate([*self.stood, *self.lost])


def _draw(axes: Any, key: str, worlds: _Worlds, palette: Sequence[str]) -> None:
    """Draw the panel of one figure."""
    known = worlds.all[np.isfinite(worlds.all)]
    if known.min() > 0.0 and known.max() > LOGARITHMIC * known.min():
        axes.set_xscale("log")
    axes.set_title(KEYS[key].heading, loc="left", fontsize="medium")
    axes.grid(alpha=0.3, axis="x")
    for place, (stood, lost, color) in enumerate(zip(worlds.stood, worlds.lost, palette, strict=True)):
        across = place + np.linspace(-0.3, 0.3, len(stood))
        axes.scatter(stood, across, color=color, alpha=0.6, linewidth=0, s=9)
        axes.scatter(lost, across, color="red", linewidth=0.8, marker="x", s=14)
        interval = known_interval(stood, KEYS[key].positive)
        if interval is not None:
            axes.plot([interval.low, interval.high], [place, place], color="black", linewidth=2.0)
            axes.plot([interval.mean], [place], "|", color="black", markersize=9)


def _until_the_end(row: ComparisonRow, key: str) -> np.ndarray:
    """Return a figure of the worlds that did not stand to the end, (n_worlds,); NaN for the others."""
    figures = [world.get(key) for world in row.entry.result.rows(row.reference)]
    values = np.array([np.nan if figure is None else figure for figure in figures], dtype=float)
    return np.where(row.entry.result.stood, np.nan, values)
