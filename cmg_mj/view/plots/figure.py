"""A figure as data, and its drawing: curves, maps, units and names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from cmg_mj.results.folder import whole_file
from cmg_mj.view.plots.style import colours, hexadecimal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW_OF_LABELS = 110
"""Characters of a legend that fit into a row."""
HEIGHT, FIRST_HEIGHT, SMALL_HEIGHT = 2.3, 1.6, 1.25
"""Heights of a panel, of a first one and of a small one below [inch]."""
LOGARITHMIC = 10.0
"""Values that differ by more than this factor have a logarithmic scale."""
PAGE_WIDTH, COLUMN_WIDTH = 9.0, 5.5
"""Widths of a page, and of each of several columns [inch]."""


@dataclass(frozen=True)
class Line:
    """One curve, or one set of marks.

    Attributes:
        x: Abscissae, (n,).
        y: Ordinates, (n,).
        label: Name in the legend; empty for none.
        style: Matplotlib's format: `-`, `--`, `.`, `o-`.
        color: An observer, for its colour in every figure; a colour as matplotlib names it; the number of a colour of
            the cycle; None for the next one.
        width: Line width [points].
        spread: Half height of a band around y, (n,), such as a confidence interval; or the heights below and above y,
            (2, n).
    """

    x: Sequence[float] | np.ndarray
    y: Sequence[float] | np.ndarray
    label: str = ""
    style: str = "-"
    color: str | int | None = None
    width: float = 1.0
    spread: Sequence[float] | np.ndarray | None = None


class Span(NamedTuple):
    """A shaded span of x, such as a push.

    Attributes:
        start: Its start.
        end: Its end.
        label: Name in the legend; empty for none.
        color: Its colour.
        height: Share of the panel's height that it takes, from the foot.
    """

    start: float
    end: float
    label: str = ""
    color: str = "C3"
    height: float = 1.0


@dataclass(frozen=True)
class Panel:
    """One set of axes.

    Attributes:
        y_label: The ordinate, with its unit.
        lines: The curves.
        title: Title above the panel, such as `(a) conventional`.
        x_label: The abscissa, with its unit; of panels that share x, only the lowest one's is shown.
        x_scale: Linear or logarithmic.
        y_scale: Linear or logarithmic.
        y_range: Limits of y; None to fit the data.
        shaded: Spans of x to shade, `Span` or its start and end.
    """

    y_label: str
    lines: Sequence[Line]
    title: str = ""
    x_label: str = "time [s]"
    x_scale: Literal["linear", "log"] = "linear"
    y_scale: Literal["linear", "log"] = "linear"
    y_range: tuple[float, float] | None = None
    shaded: Sequence[tuple[float, float]] | Sequence[Span] = ()


@dataclass(frozen=True)
class Picture:
    """Panels one below the other.

    Attributes:
        name: Name of the file, without its ending.
        title: Title of the figure, with the paper's figure number.
        panels: The panels, from top to bottom.
        share_x: Whether all panels have the same abscissa.
        columns: Number of panels beside each other.
        n_first: Number of first panels that have a row each; the others are then small, in a grid below.
    """

    name: str
    title: str
    panels: Sequence[Panel] = ()
    share_x: bool = True
    columns: int = 1
    n_first: int = 0


def pyplot() -> ModuleType:
    """Import matplotlib's pyplot, which then draws into files."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


def scale_of(values: np.ndarray) -> Literal["linear", "log"]:
    """Choose a logarithmic scale for positive values of more than one decade."""
    known = values[np.isfinite(values)]
    return "log" if 0.0 < LOGARITHMIC * known.min() < known.max() else "linear"


def save_figure(path: Path, figure: Figure, title: str, dpi: int) -> None:
    """Give a figure its title, write it as PNG, and close it."""
    figure.suptitle(title, x=0.01, ha="left", parse_math=False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")
    pyplot().close(figure)


def draw(path: Path, picture: Picture) -> None:
    """Draw a figure.

    Args:
        path: The PNG to write.
        picture: The figure's data.
    """
    columns, panels, n_first = picture.columns, picture.panels, picture.n_first
    n_rows = -(-(len(panels) - n_first) // columns)
    heights = [FIRST_HEIGHT] * n_first + [SMALL_HEIGHT if n_first else HEIGHT] * n_rows
    width = PAGE_WIDTH if n_first or columns == 1 else COLUMN_WIDTH * columns
    figure = pyplot().figure(figsize=(width, 0.8 + sum(heights)), layout="constrained")
    grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    all_axes: list[Axes] = []
    for i, panel in enumerate(panels):
        row, column = divmod(i - n_first, columns)
        if i < n_first:
            place, is_lowest, above = grid[i, :], i == n_first - 1, i - 1
        else:
            place, is_lowest = grid[n_first + row, column], i + columns >= len(panels)
            above = i - columns if row else -1
        shared = all_axes[above] if picture.share_x and above >= 0 else None
        axes = figure.add_subplot(place, sharex=shared)
        _draw_panel(axes, panel)
        all_axes.append(axes)
        if is_lowest or not picture.share_x:
            axes.set_xlabel(panel.x_label)
        axes.tick_params(labelbottom=is_lowest or not picture.share_x)
        if 0 < n_first <= i:  # a small one
            axes.set_xlabel(axes.get_xlabel(), fontsize="small")
            axes.set_ylabel(panel.y_label.replace(" [", "\n[") if column == 0 else "", fontsize="x-small")
            axes.tick_params(labelleft=column == 0, labelsize="small")
    figure.align_ylabels(all_axes[:n_first] or all_axes)
    save_figure(path, figure, picture.title, dpi=100)


def _draw_panel(axes: Axes, panel: Panel) -> None:
    from matplotlib.colors import is_color_like

    names = [line.color for line in panel.lines if isinstance(line.color, str) and not is_color_like(line.color)]
    palette = {name: hexadecimal(rgb) for name, rgb in colours(names).items()}
    for line in panel.lines:
        color = f"C{line.color}" if isinstance(line.color, int) else palette.get(line.color or "", line.color)
        label = line.label.lstrip("_")  # matplotlib hides one that begins with an underscore
        style = {"linewidth": line.width, "label": label or None}
        if color is not None:  # the format may have one
            style["color"] = color
        (curve,) = axes.plot(line.x, line.y, line.style, markersize=4, **style)
        if line.spread is not None:
            below, above = np.broadcast_to(line.spread, (2, len(line.y)))
            low, high = np.subtract(line.y, below), np.add(line.y, above)
            axes.fill_between(line.x, low, high, color=curve.get_color(), alpha=0.2, linewidth=0)
    for shaded in panel.shaded:
        span = shaded if isinstance(shaded, Span) else Span(*shaded)
        style = {"color": span.color, "alpha": 0.25, "linewidth": 0, "zorder": 0, "label": span.label or None}
        axes.axvspan(span.start, span.end, ymax=span.height, **style)
    axes.set_xscale(panel.x_scale)
    axes.set_yscale(panel.y_scale)
    axes.set_ylabel(panel.y_label)
    axes.set_title(panel.title, loc="left", fontsize="medium", parse_math=False)
    axes.grid(alpha=0.3)
    marks_only = all(set(line.style) <= set("o.x+s") for line in panel.lines)
    axes.margins(x=0.0 if panel.x_scale == "linear" and not marks_only else 0.03)
    if panel.y_range is not None:
        axes.set_ylim(*panel.y_range)
    if labels := axes.get_legend_handles_labels()[1]:
        n_columns = len(labels) if sum(map(len, labels)) < ROW_OF_LABELS else 4
        style = {"fontsize": "small", "frameon": False, "borderpad": 0, "columnspacing": 1.4}
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=n_columns, **style)
