"""A figure as data: curves, maps, units and names. `run_plot.draw` draws it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np


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
    panels: Sequence[Panel] = field(default_factory=tuple)
    share_x: bool = True
    columns: int = 1
    panel_height: float = 2.3
    panel_width: float = 5.5
    first_height: float | None = None
