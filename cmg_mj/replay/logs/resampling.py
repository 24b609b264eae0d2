"""Values at other times than their own."""

from __future__ import annotations

import numpy as np

from cmg_mj.replay.logs.timestamps import A_GAP

FEWEST = 20
"""A part with fewer rows is left out."""


def resample(grid: np.ndarray, time: np.ndarray, values: np.ndarray, gap: float, held: bool = False) -> np.ndarray:
    """Values at other times: by a cubic spline, in gaps by straight lines; held ones by the last before.

    Args:
        grid: Wanted times, (n,), within those there are [s].
        time: Times there are, growing, (m,) [s].
        values: (m,).
        gap: More between two of them is a gap [s].
        held: Whether a value counts until the next.

    Returns:
        (n,).
    """
    from scipy.interpolate import CubicSpline

    if held:
        return values[np.clip(np.searchsorted(time, grid + 1e-9, side="right") - 1, 0, len(values) - 1)]
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    in_gap = time[after] - time[after - 1] > gap
    spline = CubicSpline(time, values)(grid)
    return np.where(in_gap, np.interp(grid, time, values), spline)


def sampled_where_known(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """A reference at the samples' times; NaN before, after and in its gaps.

    Args:
        grid: The samples' times, (n,) [s].
        time: Its own times, growing, (m,) [s].
        values: (m,), NaN where it is missing.

    Returns:
        (n,).
    """
    known = np.isfinite(values)
    time, values = time[known], values[known]
    if len(time) < FEWEST:
        return np.full(len(grid), np.nan)
    gap = A_GAP * float(np.median(np.diff(time)))
    slack = 1e-6 * gap
    inside = (grid >= time[0] - slack) & (grid <= time[-1] + slack)
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    near = np.minimum(np.abs(grid - time[after - 1]), np.abs(time[after] - grid)) <= slack
    sampled = resample(np.clip(grid, time[0], time[-1]), time, values, gap)
    return np.where(inside & ((time[after] - time[after - 1] <= gap) | near), sampled, np.nan)


def bridge(grid: np.ndarray, time: np.ndarray, values: np.ndarray, held: bool) -> np.ndarray:
    """Rows that are missing, from those before and after by straight lines; held ones by the last before."""
    return resample(grid, time, values, 0.0, held) if held else np.interp(grid, time, values)
