"""Scales, ticks, titles and shares of falls of a sweep's curves and maps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from cmg_mj.studies.sweeps.cells import Trials
from cmg_mj.studies.sweeps.study import counted

ERRORS = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s")
"""Figures that are drawn, and whose indices are shown, where a trial has them; tables show the first."""
MOST_TICKS = 10


def is_logarithmic(values: Sequence[float] | np.ndarray) -> bool:
    """Judge whether values are spaced more evenly in their logarithm, such as 100, 200, 500, 1000."""
    sorted_values = np.unique(np.asarray(values, dtype=float))
    if len(sorted_values) < 3 or sorted_values[0] <= 0.0:
        return False
    steps, ratios = np.diff(sorted_values), np.diff(np.log(sorted_values))
    return bool(ratios.max() / ratios.min() < steps.max() / steps.min() * (1.0 - 1e-9))


def scale_of(trials: Trials, field: str, values: np.ndarray) -> Literal["linear", "log"]:
    """Choose the scale of a varied field's axis."""
    axis = next(axis for axis in trials.study.axes if axis.field == field)
    return "log" if (axis.log if axis.is_range else is_logarithmic(values)) else "linear"


def ticks_of(values: np.ndarray) -> list[float]:
    """Choose values to mark, not too many."""
    return [float(value) for value in values[:: math.ceil(len(values) / MOST_TICKS)]]


def round_values(values: np.ndarray) -> tuple[float, ...]:
    """Choose at most seven round numbers between the least and the greatest value; none if they are too alike."""
    known = values[np.isfinite(values) & (values > 0.0)]
    if not len(known) or known.min() == known.max():
        return ()
    low, high = float(known.min()), float(known.max())
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    levels: list[float] = []
    for marks in ((10, 20, 50), (10, 15, 20, 30, 50, 70), range(10, 100, 5), range(10, 100), range(100, 1000, 2)):
        scale = 100.0 if marks[0] == 100 else 10.0
        levels = [float(f"{mark / scale * 10.0**decade:.4g}") for decade in decades for mark in marks]
        levels = [level for level in levels if low < level < high]
        if len(levels) >= 3:
            break
    return tuple(levels[:: math.ceil(len(levels) / 7)]) if levels else ()


def fall_counts(trials: Trials) -> tuple[np.ndarray, np.ndarray]:
    """Count the worlds that fell, and those that fell or stood, (n_points, n_observers) each."""
    fell = trials.fell
    return fell.sum(axis=2), (fell | trials.stood).sum(axis=2)


def fall_shares(fell: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Compute shares of falls from such counts; NaN where every world was refused or stopped, which says neither."""
    return np.divide(fell, known, out=np.full(fell.shape, math.nan), where=known > 0)


def title_of(trials: Trials, figure: str = "") -> str:
    """Title a picture with the scenario, the figure that it shows and the number of worlds."""
    study = trials.study
    worlds = f"{counted(study.worlds, 'world')} a cell"
    return f"{study.scenario.title or 'Sweep'}: {f'{figure}, {worlds}' if figure else worlds}"
