"""Draws maps over two quantities: the best candidate with the boundaries of all, and one candidate's figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cmg_mj.view.plots.style import colours, hexadecimal, short_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.contour import QuadContourSet


EMPTY = (232, 232, 232)
"""Colour of a cell without a best."""
BOUNDARY, DASH = 2.4, 2.5
"""Width of a boundary [points], and of its dashes [line widths]."""
AHEAD = 3.2
"""Width of the dotted line within which something that is no candidate is ahead [points]."""
COLOURS_OF_VALUES = "viridis"
NUMBERED = 6
"""Most cells along an axis of a surface whose cells have room for numbers."""
CASING = "white"
"""Colour under every line, so that the line is seen on every other colour."""


@dataclass(frozen=True)
class Map:
    """The best of several candidates, over two quantities.

    Attributes:
        x: Centres of the cells to the right, (n_x,), rising.
        y: Centres of the cells upward, (n_y,), rising.
        names: The candidates, for the colours.
        best: Index in `names` of each cell's best, (n_y, n_x); negative for none.
        sure: Whether a cell's best is the best beyond chance, (n_y, n_x); the other cells have a dot.
        values: Value of each cell's best, for contours, (n_y, n_x); NaN where a cell has no best.
        levels: Levels of the contours.
        boundaries: Name -> a share, (n_y, n_x); a boundary is drawn where the share crosses one half.
        nobody: Name of a cell without a best in the legend.
        boundary: Name of the boundaries in the legend.
        ahead: Name -> a share, (n_y, n_x), above one half where something that is no candidate is better than the
            best; a dotted line is drawn where it crosses one half. NaN where that is unknown.
    """

    x: np.ndarray
    y: np.ndarray
    names: Sequence[str]
    best: np.ndarray
    sure: np.ndarray
    values: np.ndarray
    levels: Sequence[float] = ()
    boundaries: Mapping[str, np.ndarray] = field(default_factory=dict)
    nobody: str = "none"
    boundary: str = "half"
    ahead: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Surface:
    """The figure of one candidate, over two quantities.

    Attributes:
        x: Centres of the cells to the right, (n_x,), rising.
        y: Centres of the cells upward, (n_y,), rising.
        values: Value of each cell, (n_y, n_x); NaN for none.
        label: Name of the values, with their unit, for the scale of colours.
        limits: Values at the ends of the scale of colours, the same in all panels of a figure.
        scale: Linear or logarithmic scale of colours.
        levels: Levels of the contours, which are labelled, unless the cells are few enough for numbers.
    """

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    label: str
    limits: tuple[float, float]
    scale: Literal["linear", "log"] = "linear"
    levels: Sequence[float] = ()


def draw_map(axes: Axes, spec: Map) -> None:
    """Draw a map on axes whose scales are set."""
    palette = colours([*spec.names, *spec.boundaries, *spec.ahead])
    # matplotlib hides a label that begins with an underscore
    names = {name: label.lstrip("_") for name, label in short_names(list(palette)).items()}
    cells = np.array([*(palette[name] for name in spec.names), EMPTY], dtype=np.uint8)[spec.best]  # -1 is the last
    x, y = _draw_cells(axes, spec.x, spec.y, cells)

    def contour(values: np.ndarray, levels: Sequence[float], width: float, **style: Any) -> QuadContourSet:
        """Draw contours up to the map's edges, through the outermost cells, on a wider line of the casing's colour."""
        across, up = (np.concatenate([ends[:1], at, ends[-1:]]) for at, ends in ((spec.x, x), (spec.y, y)))
        padded = np.ma.masked_invalid(np.pad(values, 1, "edge"))
        axes.contour(across, up, padded, levels, colors=CASING, linewidths=width + 2.0, zorder=1.9)
        return axes.contour(across, up, padded, levels, linewidths=width, zorder=2.0, **style)

    def in_legend(style: str, label: str, **properties: Any) -> None:
        axes.plot([], [], style, label=label, **properties)

    for name in (spec.names[int(index)] for index in np.unique(spec.best[spec.best >= 0])):
        in_legend("s", names[name], color=hexadecimal(palette[name]), markersize=9)
    if (spec.best < 0).any():
        in_legend("s", spec.nobody, color=hexadecimal(EMPTY), markersize=9)
    if len(spec.levels):
        _label(axes, contour(spec.values, spec.levels, 0.8, colors="0.1"))
    unsure = (spec.best >= 0) & ~spec.sure
    if unsure.any():
        across, up = np.meshgrid(spec.x, spec.y)
        style = {"color": "0.1", "markeredgecolor": CASING, "markeredgewidth": 0.6, "markersize": 3.5}
        axes.plot(across[unsure], up[unsure], "o", label="not beyond chance", **style)
    if spec.boundaries:
        in_legend(" ", f"{spec.boundary}:")
    n = min(len(spec.boundaries), 3)
    for i, (name, share) in enumerate(spec.boundaries.items()):
        color = hexadecimal(palette[name])
        # Dashes alternate, so that two or three lines on each other are all seen.
        dashes = (i % n * DASH, (DASH, DASH * (n - 1))) if n > 1 else "-"
        contour(share, [0.5], BOUNDARY, colors=color, linestyles=[dashes])
        in_legend("--", names[name], color=color, linewidth=BOUNDARY)
    if spec.ahead:
        in_legend(" ", "less error than the best:")
    for name, share in spec.ahead.items():
        color, known = hexadecimal(palette[name]), share[np.isfinite(share)]
        if known.min(initial=1.0) < 0.5 < known.max(initial=0.0):
            contour(share, [0.5], AHEAD, colors=color, linestyles=["dotted"])
        label = f"{names[name]}, {int((share > 0.5).sum())} of {share.size} cells"
        in_legend(":", label, color=color, linewidth=AHEAD)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize="small", frameon=False, borderpad=0)


def _draw_cells(
    axes: Axes, x: np.ndarray, y: np.ndarray, values: np.ndarray, **style: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Colour the cells of a map; return their edges to the right and upward."""
    ends = edges(x, log=axes.get_xscale() == "log"), edges(y, log=axes.get_yscale() == "log")
    axes.pcolormesh(*ends, values, **style)
    axes.set_xlim(ends[0][0], ends[0][-1])
    axes.set_ylim(ends[1][0], ends[1][-1])
    return ends


def edges(centres: np.ndarray, *, log: bool) -> np.ndarray:
    """Return the edges of cells, half-way between their centres on the axis, (n + 1,)."""
    at = np.log(centres) if log else np.asarray(centres, dtype=float)
    beyond = np.concatenate([[2.0 * at[0] - at[1]], at, [2.0 * at[-1] - at[-2]]])
    result = (beyond[:-1] + beyond[1:]) / 2.0
    return np.exp(result) if log else result


def _label(axes: Axes, lines: QuadContourSet) -> None:
    for text in axes.clabel(lines, fmt="%g", fontsize="small", inline=False):
        text.set_color("0.1")
        text.set_bbox({"facecolor": CASING, "edgecolor": "none", "alpha": 0.8, "pad": 0.8})


def draw_surface(axes: Axes, spec: Surface) -> None:
    """Draw one candidate's figure on axes whose scales are set: its value by colour, and as numbers or contours."""
    norm = _norm(spec)
    values = np.ma.masked_invalid(spec.values)
    axes.set_facecolor(hexadecimal(EMPTY))
    _draw_cells(axes, spec.x, spec.y, values, cmap=COLOURS_OF_VALUES, norm=norm)
    if max(spec.values.shape) <= NUMBERED:
        for (row, column), value in np.ndenumerate(spec.values):
            if np.isfinite(value):
                ink = "white" if float(norm(value)) < 0.6 else "black"
                text = axes.text(float(spec.x[column]), float(spec.y[row]), f"{value:.3g}", color=ink)
                text.set(horizontalalignment="center", verticalalignment="center", fontsize="x-small")
    elif len(spec.levels) and np.isfinite(spec.values).any():
        _label(axes, axes.contour(spec.x, spec.y, values, spec.levels, colors=CASING, linewidths=0.9))


def mappable(spec: Surface) -> ScalarMappable:
    """Make the scale of colours of a figure's surfaces."""
    from matplotlib.cm import ScalarMappable

    return ScalarMappable(_norm(spec), COLOURS_OF_VALUES)


def _norm(spec: Surface) -> Normalize:
    from matplotlib.colors import LogNorm, Normalize

    return (LogNorm if spec.scale == "log" else Normalize)(*spec.limits)
