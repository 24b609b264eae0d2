"""A figure as data, and its drawing: curves, maps, units and names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Literal

import numpy as np

from cmg_mj.results.folder import whole_file
from cmg_mj.view.plots.map_plot import Map, Surface, draw_map, draw_surface, mappable
from cmg_mj.view.plots.style import colours, hexadecimal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Line:
    """One curve, or one set of marks.

    Attributes:
        x: Abscissae, (n,).
        y: Ordinates, (n,).
        label: Name in the legend; empty for none.
        style: Matplotlib's format: `-`, `--`, `.`, `o-`.
        color: An observer, for its colour in every figure; the number of a colour of the cycle; None for the next one.
        width: Line width [points].
        spread: Half height of a band around y, (n,), such as a confidence interval; or the heights below and above y,
            (2, n).
        bars: Whether vertical bars replace the band.
    """

    x: Sequence[float] | np.ndarray
    y: Sequence[float] | np.ndarray
    label: str = ""
    style: str = "-"
    color: str | int | None = None
    width: float = 1.0
    spread: Sequence[float] | np.ndarray | None = None
    bars: bool = False


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
        shaded: Spans of x to shade, such as pushes.
        x_ticks: Ticks on x; None for matplotlib's choice.
        y_ticks: Ticks on y; None for matplotlib's choice.
        map: A map to draw instead of lines.
        surface: A candidate's figure to draw instead of lines.
    """

    y_label: str
    lines: Sequence[Line]
    title: str = ""
    x_label: str = "time [s]"
    x_scale: Literal["linear", "log"] = "linear"
    y_scale: Literal["linear", "log"] = "linear"
    y_range: tuple[float, float] | None = None
    shaded: Sequence[tuple[float, float]] = ()
    x_ticks: Sequence[float] | None = None
    y_ticks: Sequence[float] | None = None
    map: Map | None = None
    surface: Surface | None = None


@dataclass(frozen=True)
class Picture:
    """Panels one below the other.

    Attributes:
        name: Name of the file, without its ending.
        title: Title of the figure, with the paper's figure number.
        panels: The panels, from top to bottom.
        share_x: Whether all panels have the same abscissa.
        columns: Number of panels beside each other.
        panel_height: Height of each panel [inch].
        panel_width: Width of each of several columns [inch].
        first_height: Height of the first panel, which then has a row of its own; None for a panel like the others
            [inch].
    """

    name: str
    title: str
    panels: Sequence[Panel] = ()
    share_x: bool = True
    columns: int = 1
    panel_height: float = 2.3
    panel_width: float = 5.5
    first_height: float | None = None


def pyplot() -> ModuleType:
    """Import matplotlib's pyplot, which then draws into files."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


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
    if picture.first_height is not None:
        figure = _with_large_first(picture, picture.first_height)
        save_figure(path, figure, picture.title, dpi=100)
        return
    columns = picture.columns
    rows = -(-len(picture.panels) // columns)
    size = (9.0 if columns == 1 else picture.panel_width * columns, 0.8 + picture.panel_height * rows)
    figure, grid = pyplot().subplots(
        rows, columns, sharex="col" if picture.share_x else False, figsize=size, layout="constrained", squeeze=False
    )
    for i, axes in enumerate(grid.flat):
        if i >= len(picture.panels):
            axes.set_visible(False)
            continue
        panel = picture.panels[i]
        _draw_panel(axes, panel)
        lowest = i + columns >= len(picture.panels)
        if lowest or not picture.share_x:
            axes.set_xlabel(panel.x_label)
            axes.tick_params(labelbottom=True)
    figure.align_ylabels()
    save_figure(path, figure, picture.title, dpi=100)


def _with_large_first(picture: Picture, first_height: float) -> Figure:
    """Draw the first panel over the whole width, and the others, small, in a grid below; surfaces share one scale."""
    first, others = picture.panels[0], picture.panels[1:]
    rows = -(-len(others) // picture.columns)
    heights = [first_height, *[picture.panel_height] * rows]
    size = (max(9.0, picture.panel_width * picture.columns), 0.8 + sum(heights))
    figure = pyplot().figure(figsize=size, layout="constrained")
    grid = figure.add_gridspec(len(heights), picture.columns, height_ratios=heights)
    axes = figure.add_subplot(grid[0, :])
    _draw_panel(axes, first)
    axes.set_xlabel(first.x_label)
    below: list[Axes] = []
    surface = None
    for i, panel in enumerate(others):
        row, column = divmod(i, picture.columns)
        axes = figure.add_subplot(grid[1 + row, column])
        _draw_panel(axes, panel)
        below.append(axes)
        surface = panel.surface or surface
        lowest = i + picture.columns >= len(others)
        axes.set_xlabel(panel.x_label if lowest else "", fontsize="small")
        axes.set_ylabel(panel.y_label.replace(" [", "\n[") if column == 0 else "", fontsize="x-small")
        axes.tick_params(labelbottom=lowest, labelleft=column == 0, labelsize="small")
    if surface is not None:
        bar = figure.colorbar(mappable(surface), ax=below, label=surface.label, location="bottom", aspect=60)
        ticks = sorted({*surface.levels, *([] if len(surface.levels) > 2 else surface.limits)})
        bar.set_ticks(ticks, labels=[f"{tick:.3g}" for tick in ticks])
        bar.minorticks_off()
    return figure


def _draw_panel(axes: Axes, panel: Panel) -> None:
    palette = colours(line.color for line in panel.lines if isinstance(line.color, str))
    for line in panel.lines:
        style = {"linewidth": line.width, "label": line.label or None}
        if line.color is not None:
            style["color"] = hexadecimal(palette[line.color]) if isinstance(line.color, str) else f"C{line.color}"
        (curve,) = axes.plot(line.x, line.y, line.style, markersize=4, **style)
        if line.spread is not None:
            below, above = np.broadcast_to(line.spread, (2, len(line.y)))
            low, high = np.subtract(line.y, below), np.add(line.y, above)
            if line.bars:
                axes.vlines(line.x, low, high, color=curve.get_color(), alpha=0.6, linewidth=line.width)
            else:
                axes.fill_between(line.x, low, high, color=curve.get_color(), alpha=0.2, linewidth=0)
    for start, end in panel.shaded:
        axes.axvspan(start, end, color="C3", alpha=0.25, linewidth=0, zorder=0)
    axes.set_xscale(panel.x_scale)
    axes.set_yscale(panel.y_scale)
    axes.set_ylabel(panel.y_label)
    axes.set_title(panel.title, loc="left", fontsize="medium")
    _mark(axes.xaxis, panel.x_ticks)
    _mark(axes.yaxis, panel.y_ticks)
    if panel.map is not None:
        draw_map(axes, panel.map)
        return
    if panel.surface is not None:
        draw_surface(axes, panel.surface)
        return
    axes.grid(alpha=0.3)
    marks_only = all(set(line.style) <= set("o.x+s") for line in panel.lines)
    axes.margins(x=0.0 if panel.x_scale == "linear" and not marks_only and panel.x_ticks is None else 0.03)
    if panel.y_range is not None:
        axes.set_ylim(*panel.y_range)
    if any(line.label for line in panel.lines):
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize="small", ncols=4, frameon=False, borderpad=0)


def _mark(axis: Axis, ticks: Sequence[float] | None) -> None:
    if ticks is not None:
        axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.set_ticks([], minor=True)
