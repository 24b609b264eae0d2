"""Lag, scale and offset of a reference rate relative to the measured tilt."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cmg_mj.replay.lag import lag
from cmg_mj.results.stored_columns import LONG, stretches

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
    if sum(map(len, tilt)) > LONG:
        return _alignment_by_stretches(tilt, reference, dt, span)
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


@dataclass(frozen=True)
class _Rises:
    """Increments of the tilt over a span of samples, computed where they are asked for."""

    tilt: np.ndarray
    span: int

    def __len__(self) -> int:
        return len(self.tilt) - self.span

    def __getitem__(self, rows: slice) -> np.ndarray:
        start, stop, _ = rows.indices(len(self))
        return self.tilt[start + self.span : stop + self.span] - self.tilt[start:stop]


@dataclass(frozen=True)
class _Travels:
    """Increments of the integrated reference, shifted by its lag: see `_travelled`."""

    rate: np.ndarray
    span: int
    dt: float
    lag_s: float

    def __len__(self) -> int:
        return len(self.rate) - self.span

    def __getitem__(self, rows: slice) -> np.ndarray:
        start, stop, _ = rows.indices(len(self))
        margin = math.ceil(abs(self.lag_s) / self.dt) + 2
        first = max(0, start - margin)
        rate = self.rate[first : stop + self.span + margin]
        return _travelled(rate, self.span, self.dt, self.lag_s)[start - first : stop - first]


def _alignment_by_stretches(
    tilt: Sequence[np.ndarray], reference: Sequence[np.ndarray], dt: float, span: int
) -> Alignment:
    """Compare as `alignment` does, in sums over stretches."""
    pieces = [(y, rate) for y, rate in zip(tilt, reference, strict=True) if len(y) > 2 * span]
    rises = [_Rises(y, span) for y, _ in pieces]
    lag_s = lag([_Travels(rate, span, dt, 0.0) for _, rate in pieces], rises, dt)
    travels = [_Travels(rate, span, dt, lag_s or 0.0) for _, rate in pieces]
    sums, middle = np.zeros((3, 3)), None
    for rise, travel in zip(rises, travels, strict=True):
        for rows in stretches(len(rise)):
            pairs = np.stack([np.ones(rows.stop - rows.start), travel[rows], rise[rows]])
            pairs = pairs[:, np.isfinite(pairs[1])]
            if not pairs.shape[1]:
                continue
            if middle is None:  # sums of numbers near zero lose nothing
                middle = np.array([0.0, *pairs[1:].mean(axis=1)])
            pairs -= middle[:, None]
            sums += pairs @ pairs.T
    n = sums[0, 0]
    if middle is None or n < 3:
        return Alignment(lag_s, None, None, None)
    means = sums[0, 1:] / n
    (xx, xy), (_, yy) = sums[1:, 1:] - n * np.outer(means, means)
    if not xx > 0.0 or not yy > 0.0:
        return Alignment(lag_s, None, None, None)
    slope = xy / xx
    start = (means[1] + middle[2]) - slope * (means[0] + middle[1])
    return Alignment(lag_s, float(slope), float(start / (span * dt)), float(xy / math.sqrt(xx * yy)))


def _travelled(rate: np.ndarray, span: int, dt: float, lag_s: float) -> np.ndarray:
    """Integrate a rate, shifted by its lag, over each span of samples; NaN where it is unknown, (n - span,)."""
    clock = np.arange(len(rate)) * dt
    steps = (rate[1:] + rate[:-1]) * dt / 2.0
    unknown = np.concatenate([[0], np.cumsum(np.isnan(steps))])
    travelled = np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])
    when = clock + lag_s
    travelled, unknown = (np.interp(when, clock, sums, left=np.nan, right=np.nan) for sums in (travelled, unknown))
    return np.where(unknown[span:] == unknown[:-span], travelled[span:] - travelled[:-span], np.nan)
