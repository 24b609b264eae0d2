"""A plot as data: what is drawn, with units and names. `plots.py` draws it."""

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
        label: Its name in the legend; empty for none.
        style: As matplotlib writes it: `-`, `--`, `.`, `o-`.
        color: An observer, for the colour that it has everywhere; or the number of a colour of the cycle; None for the
            next.
        width: Line width [points].
        spread: Half height of a band around y, (n,), such as a confidence interval's; or its heights below and above y,
            (2, n).
        bars: Whether it is drawn as bars instead.
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
    """Which of several is the best, over two quantities.

    Attributes:
        x: Where the cells are, (n_x,), rising.
        y: The same upward, (n_y,).
        names: Who might be the best, for the colours.
        best: The place in `names` of each cell's best, (n_y, n_x); negative for none.
        sure: Where it is the best beyond chance, (n_y, n_x); elsewhere the cell has a dot.
        values: The best's, of which contours are drawn, (n_y, n_x); NaN where there is none.
        levels: Of the contours.
        boundaries: Name -> what has crossed half beyond a boundary that is drawn, (n_y, n_x).
        nobody: What a cell without a best is called.
        boundary: What the boundaries are called.
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


@dataclass(frozen=True)
class Panel:
    """One set of axes.

    Attributes:
        y_label: What is drawn upward, with its unit.
        lines: What is drawn.
        title: Above the panel, such as `(a) conventional`.
        x_label: What is drawn to the right, with its unit; the lowest panel's counts for all with the same x.
        x_scale: Linear or logarithmic.
        y_scale: Linear or logarithmic.
        y_range: Limits; None for what the data need.
        shaded: Spans of x to shade, such as pushes.
        x_ticks: Where to mark x; None for matplotlib's choice.
        y_ticks: The same of y.
        map: What is drawn instead of lines.
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


@dataclass(frozen=True)
class Picture:
    """Panels one below the other.

    Attributes:
        name: Of the file, without its ending.
        title: Above all, with the paper's figure number.
        panels: From top to bottom.
        share_x: Whether all panels have the same abscissa.
        columns: Panels beside each other.
        panel_height: Of each [inch].
    """

    name: str
    title: str
    panels: Sequence[Panel] = field(default_factory=tuple)
    share_x: bool = True
    columns: int = 1
    panel_height: float = 2.3
