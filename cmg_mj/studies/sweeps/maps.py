"""Maps of a sweep over two varied fields, with the best observer of every cell."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.results.intervals import known_interval
from cmg_mj.results.summary_keys import heading
from cmg_mj.studies.sweeps.cells import Trials, fell_interval
from cmg_mj.studies.sweeps.plot_scales import (
    ERRORS,
    fall_counts,
    fall_shares,
    round_values,
    scale_of,
    ticks_of,
    title_of,
)
from cmg_mj.visualization.plots.figure_spec import Map, Panel, Picture

MAPS = {ERRORS[0]: "map_velocity_error", ERRORS[1]: "map_push_error", "fell": "map_falls"}
"""Figure -> its picture."""


def maps(trials: Trials, across: str, up: str) -> list[Picture]:
    """Draw a map a figure, and one of the share of falls if there are any; both fields in a grid."""
    study = trials.study
    values = {axis.field: np.array(axis.values, dtype=float) for axis in study.axes if axis.field in (across, up)}
    x_order, y_order = np.argsort(values[across]), np.argsort(values[up])
    x, y = values[across][x_order], values[up][y_order]

    def gridded(points: np.ndarray) -> np.ndarray:
        """(n_points, ...) -> (n_y, n_x, ...); points go through the second field first."""
        return points.reshape(len(x), len(y), *points.shape[1:]).swapaxes(0, 1)[y_order][:, x_order]

    fell, known = (gridded(counts) for counts in fall_counts(trials))
    shares = fall_shares(fell, known)
    halves = {name: shares[:, :, i] for i, name in enumerate(study.observers)}
    boundaries = {name: half for name, half in halves.items() if (half < 0.5).any() and (half > 0.5).any()}
    pictures = []
    for key, name in MAPS.items():
        if key == "fell":
            if not trials.fell.any():
                continue
            best, sure, least = _least_falls(fell, known)
            label, value, levels, nobody = "share of falls", "share", (0.1, 0.9), "several alike"
        else:
            figure = gridded(trials.figure(key))
            if not np.isfinite(figure).any():
                continue
            best, sure, least = _least_error(figure)
            label, value, levels, nobody = heading(key), "mean", round_values(least), "none stood in every world"
        cells = Map(x, y, study.observers, best, sure, least, levels, boundaries, nobody, "half of the worlds fall")
        panel = Panel(
            up,
            (),
            f"colour: the best observer; contours: its {value}",
            across,
            scale_of(trials, across, x),
            scale_of(trials, up, y),
            x_ticks=ticks_of(x),
            y_ticks=ticks_of(y),
            map=cells,
        )
        pictures.append(Picture(name, title_of(trials, label), [panel], panel_height=4.7))
    return pictures


def _least_error(figure: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the best mean among those that stood in every world, (n_y, n_x, n_observers, n_worlds) -> (n_y, n_x) each.

    The best is sure if its mean difference to every other, world by world, is beyond its 95 % interval.
    """
    means = figure.mean(axis=3)
    best, least = _smallest(means)
    sure = np.zeros(best.shape, dtype=bool)
    for at in zip(*np.nonzero(best >= 0), strict=True):
        others = [i for i in np.nonzero(np.isfinite(means[at]))[0] if i != best[at]]
        behind = [known_interval(figure[at][i] - figure[at][best[at]]) for i in others]
        sure[at] = all(interval is not None and interval.low > 0.0 for interval in behind)
    return best, sure, least


def _least_falls(fell: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find who falls the least, unless several do, (n_y, n_x, n_observers) -> (n_y, n_x) each.

    The best is sure if its Wilson interval is below those of all others.
    """
    shares = fall_shares(fell, known)
    best, least = _smallest(shares)
    best[(shares == least[:, :, None]).sum(axis=2) > 1] = -1
    sure = np.zeros(best.shape, dtype=bool)
    for at in zip(*np.nonzero(best >= 0), strict=True):
        intervals = [fell_interval(n, trials) for n, trials in zip(fell[at], known[at], strict=True) if trials]
        low = sorted(intervals, key=lambda interval: interval.mean)
        sure[at] = all(low[0].high < other.low for other in low[1:])
    return best, sure, least


def _smallest(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the place of the smallest along the last axis, -1 where there is none, and its value."""
    filled = np.where(np.isfinite(values), values, np.inf)
    least = filled.min(axis=-1)
    return np.where(np.isfinite(least), filled.argmin(axis=-1), -1), np.where(np.isfinite(least), least, math.nan)
