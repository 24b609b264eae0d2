"""Resampling of rows: whether their stamps are even, and values at other times."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cmg_mj.results.stored_columns import LONG, stretches

EVEN = 0.02
"""Deviation from an even grid, in periods, up to which stamps count as even."""
SAME_PERIOD = 1e-3
"""Relative difference up to which the line through the rows has their period."""
GAP_PERIODS = 1.5
"""A gap is longer than so many periods."""
FEWEST = 20
MARGIN = 100
"""Rows to either side of a stretch from which its spline is made: a row's influence falls to a quarter from each row to
the next."""
"""A part with fewer rows is discarded."""


def resample(grid: np.ndarray, time: np.ndarray, values: np.ndarray, gap: float, held: bool = False) -> np.ndarray:
    """Interpolate by a cubic spline, in gaps by straight lines; held values by the last one before.

    Args:
        grid: Wanted times, (n,), within those there are [s].
        time: Times there are, growing, (m,) [s].
        values: (m,).
        gap: More between two of them is a gap [s].
        held: Whether a value holds until the next.

    Returns:
        (n,).
    """
    from scipy.interpolate import CubicSpline

    if held:
        return values[np.clip(np.searchsorted(time, grid + 1e-9, side="right") - 1, 0, len(values) - 1)]
    if len(grid) > LONG:
        return _in_stretches(lambda some, part, v: resample(some, part, v, gap), grid, time, values)
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    in_gap = time[after] - time[after - 1] > gap
    spline = CubicSpline(time, values)(grid)
    return np.where(in_gap, np.interp(grid, time, values), spline)


def _in_stretches(
    function: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    grid: np.ndarray,
    time: np.ndarray,
    values: np.ndarray,
) -> np.ndarray:
    """Interpolate stretch by stretch, each from its own rows and `MARGIN` more to either side."""
    out = np.empty(len(grid))
    for some in stretches(len(grid)):
        first, last = np.searchsorted(time, [grid[some.start], grid[some.stop - 1]])
        rows = slice(max(0, int(first) - MARGIN), int(last) + MARGIN)
        out[some] = function(grid[some], time[rows], values[rows])
    return out


def sampled_where_known(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Interpolate a reference at the samples' times; NaN before it, after it and in its gaps.

    Args:
        grid: The samples' times, (n,) [s].
        time: Its own times, growing, (m,) [s].
        values: (m,), NaN where it is missing.

    Returns:
        (n,).
    """
    known = np.isfinite(values)
    if not known.all():
        time, values = time[known], values[known]
    if len(time) < FEWEST:
        return np.full(len(grid), np.nan)
    gap = GAP_PERIODS * float(np.median(np.diff(time), overwrite_input=True))
    if len(grid) > LONG:
        return _in_stretches(lambda some, part, v: _sampled(some, part, v, gap), grid, time, values)
    return _sampled(grid, time, values, gap)


def _sampled(grid: np.ndarray, time: np.ndarray, values: np.ndarray, gap: float) -> np.ndarray:
    slack = 1e-6 * gap
    inside = (grid >= time[0] - slack) & (grid <= time[-1] + slack)
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    near = np.minimum(np.abs(grid - time[after - 1]), np.abs(time[after] - grid)) <= slack
    sampled = resample(np.clip(grid, time[0], time[-1]), time, values, gap)
    return np.where(inside & ((time[after] - time[after - 1] <= gap) | near), sampled, np.nan)


def bridge(grid: np.ndarray, time: np.ndarray, values: np.ndarray, held: bool) -> np.ndarray:
    """Fill missing rows by straight lines; held values by the last one before."""
    return resample(grid, time, values, 0.0, held) if held else np.interp(grid, time, values)


def rounded_period(period: float) -> float:
    """Return the period of a round rate, if the period is one to the stamps' accuracy."""
    rate = float(f"{1.0 / period:.6g}")
    return 1.0 / rate if abs(period * rate - 1.0) < 1e-9 else period


def resolution_of(time: np.ndarray) -> float:
    """Return the largest of 1, 0.1, 0.01 ... s that divides all stamps from the first on [s]; 0 if none does."""
    for power in range(0, 8):
        counts = (time - time[0]) * 10.0**power
        if np.abs(counts - np.rint(counts)).max() < 1e-3:
            return 10.0**-power
    return 0.0


def is_even(time: np.ndarray, period: float, resolution: float) -> bool:
    """Return whether the rows are on an even grid, as far as stamps of this resolution show."""
    if len(time) < 3:
        return True
    slack = max(EVEN * period, 0.75 * resolution if resolution < period else 0.0)
    steps = np.diff(time)
    if np.ptp(steps) < EVEN * period:
        return True
    in_order = steps.max() < GAP_PERIODS * period
    del steps
    if len(time) > LONG:
        return _is_on_a_line(time, period, slack, in_order)
    order = np.arange(len(time)) if in_order else np.rint((time - time[0]) / period)
    fit = np.polynomial.polynomial.polyfit(order, time - time[0], 1)
    off = time - time[0] - (fit[0] + fit[1] * order)
    return bool(np.abs(off).max() <= slack and abs(fit[1] / period - 1.0) < SAME_PERIOD)


def _is_on_a_line(time: np.ndarray, period: float, slack: float, in_order: bool) -> bool:
    """Compare the rows of a long log with the straight line through them, stretch by stretch, as `is_even` does."""
    middle = 0.5 * (len(time) - 1 if in_order else (time[-1] - time[0]) / period)

    def stretch(rows: slice) -> tuple[np.ndarray, np.ndarray]:
        since = time[rows] - time[0]
        order = np.arange(rows.start, rows.stop) if in_order else np.rint(since / period)
        return order - middle, since - middle * period

    sums = np.zeros(4)
    for rows in stretches(len(time)):
        x, y = stretch(rows)
        sums += x.sum(), y.sum(), x @ x, x @ y
    x_mean, y_mean = sums[:2] / len(time)
    slope = (sums[3] - len(time) * x_mean * y_mean) / (sums[2] - len(time) * x_mean**2)
    offs = (y - y_mean - slope * (x - x_mean) for x, y in map(stretch, stretches(len(time))))
    return bool(max(np.abs(off).max() for off in offs) <= slack and abs(slope / period - 1.0) < SAME_PERIOD)
