"""A plot as data: what is drawn, with units and names. `plots.py` draws it."""

from __future__ import annotations

from collections.abc import Sequence
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
        spread: Half height of a band around y, (n,), such as a confidence interval's.
    """

    x: Sequence[float] | np.ndarray
    y: Sequence[float] | np.ndarray
    label: str = ""
    style: str = "-"
    color: str | int | None = None
    width: float = 1.0
    spread: Sequence[float] | np.ndarray | None = None


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
    """

    y_label: str
    lines: Sequence[Line]
    title: str = ""
    x_label: str = "time [s]"
    x_scale: Literal["linear", "log"] = "linear"
    y_scale: Literal["linear", "log"] = "linear"
    y_range: tuple[float, float] | None = None
    shaded: Sequence[tuple[float, float]] = ()


@dataclass(frozen=True)
class Picture:
    """Panels one below the other.

    Attributes:
        name: Of the file, without its ending.
        title: Above all, with the paper's figure number.
        panels: From top to bottom.
        share_x: Whether all panels have the same abscissa.
        columns: Panels beside each other.
    """

    name: str
    title: str
    panels: Sequence[Panel] = field(default_factory=tuple)
    share_x: bool = True
    columns: int = 1
