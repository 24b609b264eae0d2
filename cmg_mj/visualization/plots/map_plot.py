"""A map drawn: who is the best over two quantities, how good it is, and where what is judged breaks down."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cmg_mj.visualization.plots.colours import colours, hexadecimal
from cmg_mj.visualization.plots.figure_spec import Map
from cmg_mj.visualization.plots.readability import short_names

EMPTY = (232, 232, 232)
"""A cell without a best."""
BOUNDARY, DASH = 2.4, 2.5
"""Width of a line where half fall [points], and its dashes [widths]."""
CASING = "white"
"""Under every line, which has to be seen on every colour."""


def draw_map(axes: Any, drawn: Map) -> None:
    """Draw a map on axes whose scales are set.

    Args:
        axes: Matplotlib's.
        drawn: What to draw.
    """
    palette = colours(drawn.names)
    observers = list(drawn.names)
    names = short_names(observers)
    filled = np.array([*palette.values(), EMPTY], dtype=np.uint8)[drawn.best]  # -1 is the last
    x = edges(drawn.x, log=axes.get_xscale() == "log")
    y = edges(drawn.y, log=axes.get_yscale() == "log")
    axes.pcolormesh(x, y, filled)
    _contours(axes, drawn, x, y)
    _boundaries(axes, drawn, x, y, [hexadecimal(palette[name]) for name in drawn.boundaries])
    unsure = (drawn.best >= 0) & ~drawn.sure
    across, up = np.meshgrid(drawn.x, drawn.y)
    axes.plot(across[unsure], up[unsure], "o", color="0.1", markeredgecolor=CASING, markeredgewidth=0.6, markersize=3.5)
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    for place in np.unique(drawn.best[drawn.best >= 0]):
        name = observers[place]
        _in_legend(axes, "s", names[name], color=hexadecimal(palette[name]), markersize=9)
    if (drawn.best < 0).any():
        _in_legend(axes, "s", drawn.nobody, color=hexadecimal(EMPTY), markersize=9)
    if unsure.any():
        _in_legend(axes, "o", "not beyond chance", color="0.1", markersize=3.5)
    if drawn.boundaries:
        _in_legend(axes, " ", f"{drawn.boundary}:")
    for name in drawn.boundaries:
        _in_legend(axes, "--", names[name], color=hexadecimal(palette[name]), linewidth=BOUNDARY)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize="small", frameon=False, borderpad=0)


def edges(places: np.ndarray, *, log: bool) -> np.ndarray:
    """Where cells end: half-way between their places on the axis, (n + 1,)."""
    on_axis = np.log(places) if log else np.asarray(places, dtype=float)
    between = (on_axis[:-1] + on_axis[1:]) / 2.0
    found = np.concatenate([[2 * on_axis[0] - between[0]], between, [2 * on_axis[-1] - between[-1]]])
    return np.exp(found) if log else found


def _contours(axes: Any, drawn: Map, x: np.ndarray, y: np.ndarray) -> None:
    if not len(drawn.levels):
        return
    values = _to_the_edges(drawn.x, x), _to_the_edges(drawn.y, y), np.ma.masked_invalid(np.pad(drawn.values, 1, "edge"))
    axes.contour(*values, drawn.levels, colors=CASING, linewidths=2.2)
    lines = axes.contour(*values, drawn.levels, colors="0.1", linewidths=0.8)
    for text in axes.clabel(lines, fmt="%g", fontsize="small"):
        text.set_bbox({"facecolor": CASING, "edgecolor": "none", "alpha": 0.8, "pad": 0.8})


def _boundaries(axes: Any, drawn: Map, x: np.ndarray, y: np.ndarray, palette: Sequence[str]) -> None:
    """Dashes begin one after the other: of two or three lines in one place each is seen."""
    across, up = _to_the_edges(drawn.x, x), _to_the_edges(drawn.y, y)
    shares = [np.ma.masked_invalid(np.pad(share, 1, "edge")) for share in drawn.boundaries.values()]
    for share in shares:
        axes.contour(across, up, share, [0.5], colors=CASING, linewidths=BOUNDARY + 2.0)
    together = min(len(shares), 3)
    for i, (share, color) in enumerate(zip(shares, palette, strict=True)):
        style = (i % together * DASH, (DASH, DASH * (together - 1))) if together > 1 else "-"
        axes.contour(across, up, share, [0.5], colors=color, linewidths=BOUNDARY, linestyles=[style])


def _to_the_edges(places: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Lines go on to the edge of the outermost cells, which are of one value."""
    return np.concatenate([ends[:1], places, ends[-1:]])


def _in_legend(axes: Any, style: str, label: str, **how: Any) -> None:
    axes.plot([], [], style, label=label.lstrip("_"), **how)  # matplotlib hides what begins with an underscore
