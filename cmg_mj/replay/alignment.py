"""Lag, scale and offset of a reference rate relative to the measured tilt."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.replay.lag import lag

SPAN_S = 0.2
"""Time over which increments of the tilt and of the integrated reference are compared [s]; slopes are mostly noise."""


class Alignment(NamedTuple):
    """Lag, scale and offset of a reference relative to the measured tilt; None where they cannot be found."""

    lag_s: float | None
    """Lag of the reference behind the tilt, as it was read [s]."""
    scale: float | None
    """Factor of the reference that fits the tilt's increments."""
    offset_rad_s: float | None
    """Addend after the scale [rad/s]."""
    correlation: float | None
    """Correlation of the increments, near -1 for a reference of the other sign."""


def alignment(tilt: Sequence[np.ndarray], reference: Sequence[np.ndarray], dt: float) -> Alignment:
    """Compare the tilt's increments over `SPAN_S` with those of the integrated reference, at every sample.

    The lag is where the two correlate most. The tilt's increments are then fitted by the reference's, shifted by it.

    Args:
        tilt: Pieces of the tilt, each (n,) [rad].
        reference: Pieces of the rate, each (n,) [rad/s]; NaN where it is unknown.
        dt: Sample period [s].

    Returns:
        The alignment.
    """
    span = max(2, round(SPAN_S / dt))
    pieces = [(y, rate) for y, rate in zip(tilt, reference, strict=True) if len(y) > 2 * span]
    rises = [y[span:] - y[:-span] for y, _ in pieces]
    lag_s = lag([_travelled(rate, span, dt, 0.0) for _, rate in pieces], rises, dt)
    travels = [_travelled(rate, span, dt, lag_s or 0.0) for _, rate in pieces]
    if not rises:
        return Alignment(lag_s, None, None, None)
    rise, travel = np.concatenate(rises), np.concatenate(travels)
    rise, travel = rise[np.isfinite(travel)], travel[np.isfinite(travel)]
    rounding = np.finfo(float).eps * len(travel) * float(np.abs(travel).max(initial=0.0))
    if len(rise) < 3 or not np.ptp(travel) > rounding or not np.ptp(rise) > 0.0:
        return Alignment(lag_s, None, None, None)
    correlation = float(np.corrcoef(rise, travel)[0, 1])
    slope, start = np.polynomial.polynomial.polyfit(travel, rise, 1)[::-1]
    return Alignment(lag_s, float(slope), float(start / (span * dt)), correlation)


def _travelled(rate: np.ndarray, span: int, dt: float, lag_s: float) -> np.ndarray:
    """Integrate a rate, shifted by its lag, over each span of samples; NaN where it is unknown, (n - span,)."""
    clock = np.arange(len(rate)) * dt
    steps = (rate[1:] + rate[:-1]) * dt / 2.0
    unknown = np.concatenate([[0], np.cumsum(np.isnan(steps))])
    travelled = np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])
    when = clock + lag_s
    travelled, unknown = (np.interp(when, clock, sums, left=np.nan, right=np.nan) for sums in (travelled, unknown))
    return np.where(unknown[span:] == unknown[:-span], travelled[span:] - travelled[:-span], np.nan)
