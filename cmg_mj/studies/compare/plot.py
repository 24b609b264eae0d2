"""A plot of the distribution of every figure of a comparison over the worlds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cmg_mj.results.intervals import known_interval
from cmg_mj.results.summary_keys import KEYS
from cmg_mj.studies.compare.comparison import ComparedObserver
from cmg_mj.studies.compare.statistics import ComparisonRow, comparison_rows
from cmg_mj.visualization.plots.figure_spec import pyplot, save_figure
from cmg_mj.visualization.plots.style import colours, hexadecimal, short_names

COLUMNS = 3
"""Panels in a row."""
LOGARITHMIC = 10.0
"""Positive figures that differ by more than this factor are drawn on a logarithmic axis."""
FAR_OUT = 3.0
"""Quartile ranges outside the observers' means, beyond which a linear axis shows a figure at its edge."""


def plot_worlds(path: Path, compared: Sequence[ComparedObserver], title: str) -> None:
    """Draw a panel a figure, with the observers on one axis: every world, the mean and its 95 % interval.

    Worlds that did not stand to the end are crosses, at the figure until then; the mean is without them.

    Args:
        path: The PNG to write.
        compared: The observers with their runs.
        title: The scenario's title.
    """
    rows = comparison_rows(compared)
    drawn = {key: panel for key in KEYS if KEYS[key].compared and (panel := _Panel(key, rows)).any}
    down = -(-len(drawn) // COLUMNS)
    size = (12.0, 1.2 + down * (0.9 + 0.22 * len(rows)))
    figure, grid = pyplot().subplots(down, COLUMNS, sharey=True, figsize=size, layout="constrained", squeeze=False)
    for axes in grid.flat[len(drawn) :]:
        axes.set_visible(False)
    for axes, panel in zip(grid.flat, drawn.values(), strict=False):
        panel.draw(axes)
    first = grid.flat[0]
    names = short_names([row.name for row in rows])
    first.set_yticks(range(len(rows)), [_label(row, names[row.name]) for row in rows])
    first.invert_yaxis()  # shared: the table's order in every panel
    worlds = len(rows[0].entry.result.outcomes)
    heading = f"{title or 'Comparison'}: {worlds} worlds an observer. "
    heading += "Lines: mean and its 95 % interval; arrows: beyond the axis."
    if not all(row.entry.result.stood.all() for row in rows):
        heading += " Crosses: worlds that did not stand to the end, until then."
    save_figure(path, figure, heading, dpi=100)


def _label(row: ComparisonRow, name: str) -> str:
    """Label a row with its name and the number of worlds that did not stand."""
    lost = int((~row.entry.result.stood).sum())
    return f"{name} ({lost} lost)" if lost and not row.reference else name


class _Panel:
    """The panel of one figure, with every world of every row.

    Attributes:
        any: Whether any world has the figure.
    """

    def __init__(self, key: str, rows: Sequence[ComparisonRow]) -> None:
        self.key = key
        self.stood = [row.values(key) for row in rows]
        self.lost = [_until_the_end(row, key) for row in rows]
        self.colours = [hexadecimal(colour) for colour in colours(row.name for row in rows).values()]
        values = np.concatenate([*self.stood, *self.lost])
        self.any = bool(np.isfinite(values).any())
        if self.any:
            self._scale(values[np.isfinite(values)])

    def _scale(self, values: np.ndarray) -> None:
        """Choose the axis and its limits, so that one observer that is far off leaves room for the others."""
        low, high = float(values.min()), float(values.max())
        self.scale = "log" if low > 0.0 and high > LOGARITHMIC * low else "linear"
        if self.scale == "log":
            self.limits = low / 1.2, high * 1.2
            return
        means = [known.mean() for row in self.stood if len(known := row[np.isfinite(row)])] or [low, high]
        quarter, three = np.quantile(means, [0.25, 0.75])
        room = FAR_OUT * (three - quarter)
        best = KEYS[self.key].better == "more"  # whose good end is near, 1: what is there is always seen
        near = values[(values >= quarter - room) & ((values <= three + room) | best)] if room else values
        low, high = float(near.min()), float(near.max())
        margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
        self.limits = low - margin, high + margin

    def draw(self, axes: Any) -> None:
        """Draw the panel."""
        axes.set_xscale(self.scale)
        axes.set_xlim(*self.limits)
        if self.scale == "log":
            ticks = _ticks(*self.limits)
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            axes.minorticks_off()
        axes.set_title(KEYS[self.key].heading, loc="left", fontsize="medium")
        axes.grid(alpha=0.3, axis="x")
        for place, (stood, lost, color) in enumerate(zip(self.stood, self.lost, self.colours, strict=True)):
            self._scatter(partial(axes.scatter, color=color, alpha=0.6, linewidth=0), place, stood, "o", 9)
            self._scatter(partial(axes.scatter, color="red", linewidth=0.8), place, lost, "x", 14)
            interval = known_interval(stood, KEYS[self.key].positive)
            if interval is not None:
                axes.plot([interval.low, interval.high], [place, place], color="black", linewidth=2.0)
                axes.plot([interval.mean], [place], "|", color="black", markersize=9)

    def _scatter(self, draw: partial[None], place: int, values: np.ndarray, marker: str, size: float) -> None:
        """Draw the worlds in their order across a row; those outside the axis as arrow heads at its edge."""
        rows = place + np.linspace(-0.3, 0.3, len(values)) if len(values) > 1 else np.full(len(values), float(place))
        low, high = self.limits
        inside = (values >= low) & (values <= high)
        draw(values[inside], rows[inside], marker=marker, s=size)
        for out, edge, head in ((values < low, low, "<"), (values > high, high, ">")):
            if out.any():
                draw(np.full(out.sum(), edge), rows[out], marker=head, s=16, clip_on=False, zorder=3)


def _ticks(low: float, high: float) -> list[float]:
    """Choose round numbers on a logarithmic axis, which has room for a handful."""
    first_digits = (1,) if high > 100.0 * low else (1, 3) if high > 30.0 * low else (1, 2, 5)
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [tick for decade in decades for first in first_digits if low <= (tick := float(f"{first}e{decade}")) <= high]


def _until_the_end(row: ComparisonRow, key: str) -> np.ndarray:
    """Return a figure of the worlds that did not stand to the end, (n_worlds,); NaN for the others."""
    figures = [world.get(key) for world in row.entry.result.rows(row.reference)]
    values = np.array([np.nan if figure is None else figure for figure in figures], dtype=float)
    return np.where(row.entry.result.stood, np.nan, values)
