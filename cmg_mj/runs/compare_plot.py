"""A plot of the distribution of every figure of a comparison over the worlds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cmg_mj.results.intervals import known_interval
from cmg_mj.results.summary_keys import KEYS
from cmg_mj.runs.comparison import ComparedObserver, comparison_rows
from cmg_mj.view.plots.figure import pyplot, save_figure, scale_of
from cmg_mj.view.plots.style import colours, hexadecimal, short_names

COLUMNS = 3
"""Panels in a row."""


def plot_worlds(path: Path, compared: Sequence[ComparedObserver], title: str) -> None:
    """Draw a panel a figure, with the observers on one axis: every world, the mean and its 95 % interval.

    Worlds that did not stand to the end are crosses, at the figure until then; the mean is without them.

    Args:
        path: The PNG to write.
        compared: The observers with their runs.
        title: The scenario's title.
    """
    rows = comparison_rows(compared)
    figures = {key: [row.figures(key) for row in rows] for key, about in KEYS.items() if about.compared}
    drawn = {key: worlds for key, worlds in figures.items() if np.isfinite(worlds).any()}
    down = -(-len(drawn) // COLUMNS)
    size = (12.0, 1.2 + down * (0.9 + 0.22 * len(rows)))
    figure, grid = pyplot().subplots(down, COLUMNS, sharey=True, figsize=size, layout="constrained", squeeze=False)
    for axes in grid.flat[len(drawn) :]:
        axes.set_visible(False)
    palette = [hexadecimal(colour) for colour in colours(row.name for row in rows).values()]
    stood = [row.entry.result.stood for row in rows]
    for axes, (key, worlds) in zip(grid.flat, drawn.items(), strict=False):
        axes.set_xscale(scale_of(np.concatenate(worlds)))
        axes.set_title(KEYS[key].heading, loc="left", fontsize="medium")
        axes.grid(alpha=0.3, axis="x")
        for place, (values, upright, color) in enumerate(zip(worlds, stood, palette, strict=True)):
            across = place + np.linspace(-0.3, 0.3, len(values))
            axes.scatter(values[upright], across[upright], color=color, alpha=0.6, linewidth=0, s=9)
            axes.scatter(values[~upright], across[~upright], color="red", linewidth=0.8, marker="x", s=14)
            interval = known_interval(values[upright], KEYS[key].positive)
            if interval is not None:
                axes.plot([interval.low, interval.high], [place, place], color="black", linewidth=2.0)
                axes.plot([interval.mean], [place], "|", color="black", markersize=9)
    first = grid.flat[0]
    names = short_names([row.name for row in rows])
    lost = [
        "" if row.reference or world.all() else f" ({(~world).sum()} lost)"
        for row, world in zip(rows, stood, strict=True)
    ]
    first.set_yticks(range(len(rows)), [names[row.name] + more for row, more in zip(rows, lost, strict=True)])
    first.invert_yaxis()  # shared: the table's order in every panel
    heading = f"{title or 'Comparison'}: {len(stood[0])} worlds an observer. Lines: mean and its 95 % interval."
    if not np.all(stood):
        heading += " Crosses: worlds that did not stand to the end, until then."
    save_figure(path, figure, heading, dpi=100)
