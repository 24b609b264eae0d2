"""How far one signal lags behind another, finer than a sample; and what a reference is to a measured tilt."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

LONGEST_LAG_S = 0.5
"""Lags are looked for up to this, and no farther than a quarter of what there is [s]."""
AS_GOOD = 0.98
"""A periodic motion fits itself every period: of peaks this close to the highest, the one nearest to no lag counts."""
ALIKE = 0.5
"""Of an estimate whose correlation peaks lower, less than a quarter of the variance is the reference, however late."""
FAINT = 0.1
"""Enough for a measured tilt's slopes: most of them may be noise, which is white and has no peak of its own."""
SPAN_S = 0.2
"""A reference's size is taken from how far it says the tilt has come in so long [s]."""


def lag(
    behind: Sequence[np.ndarray],
    ahead: Sequence[np.ndarray],
    dt: float,
    longest_s: float = LONGEST_LAG_S,
    least: float = ALIKE,
) -> float | None:
    """How long one signal comes after another: the peak of their correlation coefficient, between the samples too.

    For every whole number of samples the coefficient is that of all pairs there are; a quintic spline through these has
    its peak where a pure delay is, whatever the signals' sizes.

    Args:
        behind: Its pieces, each (n,); NaN where it is not known.
        ahead: The pieces of the other at the same times.
        dt: Sample period [s].
        longest_s: Longest lag looked for, either way [s].
        least: A correlation coefficient whose peak is lower shows no lag.

    Returns:
        The lag [s], negative if it comes before; None if there is none: no motion, no likeness, or the peak at the end.
    """
    size = max((len(piece) for piece in behind), default=0)
    reach = min(math.ceil(longest_s / dt), (size - 1) // 4)
    if reach < 1:
        return None
    lags = np.arange(-reach, reach + 1)
    sums = np.zeros((6, len(lags)))
    for x, y in zip(behind, ahead, strict=True):
        if len(x) > 2 * reach:
            sums += _sums(x, y, reach)
    n, sx, sy, sxx, syy, sxy = sums
    with np.errstate(all="ignore"):
        r = (sxy - sx * sy / n) / np.sqrt((sxx - sx * sx / n) * (syy - sy * sy / n))
    if not np.isfinite(r).all() or r.max() <= least:
        return None
    peaks = [i for i in range(1, len(r) - 1) if r[i - 1] < r[i] >= r[i + 1] and r[i] >= AS_GOOD * r.max()]
    if not peaks:
        return None
    return float(_peak(lags, r, min(peaks, key=lambda i: abs(lags[i])))) * dt


def _sums(x: np.ndarray, y: np.ndarray, reach: int) -> np.ndarray:
    """For every lag of x behind y the count, sums, squares and products of the pairs that are known."""
    from scipy.signal import correlate

    known_x, known_y = np.isfinite(x), np.isfinite(y)
    # Numbers of like size: of the products of transforms, what is far smaller than the largest is lost.
    x = np.where(known_x, x - (x[known_x].mean() if known_x.any() else 0.0), 0.0)
    y = np.where(known_y, y - (y[known_y].mean() if known_y.any() else 0.0), 0.0)
    middle = len(y) - 1
    window = slice(middle - reach, middle + reach + 1)
    ones_x, ones_y = known_x.astype(float), known_y.astype(float)
    pairs = ((ones_x, ones_y), (x, ones_y), (ones_x, y), (x * x, ones_y), (ones_x, y * y), (x, y))
    return np.array([correlate(a, b, mode="full", method="fft")[window] for a, b in pairs])


def _peak(lags: np.ndarray, r: np.ndarray, at: int) -> float:
    """Where between the samples a curve through them is highest, in samples."""
    from scipy.interpolate import make_interp_spline
    from scipy.optimize import minimize_scalar

    around = slice(max(0, at - 8), at + 9)
    if len(r[around]) < 6:
        return float(lags[at])
    curve = make_interp_spline(lags[around], r[around], k=5)
    ends = (lags[at] - 1, lags[at] + 1)
    found = minimize_scalar(lambda m: -curve(m), bounds=ends, method="bounded", options={"xatol": 1e-7})
    return float(found.x)  # pyright: ignore[reportAttributeAccessIssue]


class Alignment(NamedTuple):
    """What a reference is to the measured tilt, found from the two alone."""

    lag_s: float | None
    """How far it comes behind the tilt, as it was read [s]."""
    scale: float | None
    """By what it must be multiplied to say how far the tilt has come."""
    offset_rad_s: float | None
    """What must be added then [rad/s]."""
    correlation: float | None
    """Of its increments with the tilt's: near -1 if it counts the other way."""


def alignment(tilt: Sequence[np.ndarray], reference: Sequence[np.ndarray], dt: float) -> Alignment:
    """Compare a reference with the tilt's central difference (lag), its integral with the tilt (scale, offset).

    Over `SPAN_S` each, the tilt's increments are fitted by those of the reference's integral, taken back by its lag.

    Args:
        tilt: Its pieces, each (n,) [rad].
        reference: The pieces of the rate [rad/s]; NaN where it is not known.
        dt: Sample period [s].

    Returns:
        The four numbers; None for those that cannot be found.
    """
    slopes = [np.gradient(piece, dt) for piece in tilt]
    found = lag(reference, slopes, dt, least=FAINT)
    span = max(2, round(SPAN_S / dt))
    rises, travels = [], []
    for y, rate in zip(tilt, reference, strict=True):
        if len(y) <= 2 * span:
            continue
        clock = np.arange(len(y)) * dt
        steps = (rate[1:] + rate[:-1]) * dt / 2.0
        unknown = np.concatenate([[0], np.cumsum(np.isnan(steps))])
        travelled = np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])
        when = clock + (found or 0.0)
        travelled, unknown = (np.interp(when, clock, sums, left=np.nan, right=np.nan) for sums in (travelled, unknown))
        gapless = unknown[span:] == unknown[:-span]
        rises.append((y[span:] - y[:-span])[gapless])
        travels.append((travelled[span:] - travelled[:-span])[gapless])
    if not rises:
        return Alignment(found, None, None, None)
    rise, travel = np.concatenate(rises), np.concatenate(travels)
    if len(rise) < 3 or not np.ptp(travel) > 0.0 or not np.ptp(rise) > 0.0:
        return Alignment(found, None, None, None)
    correlation = float(np.corrcoef(rise, travel)[0, 1])
    slope, start = np.polynomial.polynomial.polyfit(travel, rise, 1)[::-1]
    return Alignment(found, float(slope), float(start / (span * dt)), correlation)
