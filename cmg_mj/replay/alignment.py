"""Lag, scale and offset of a reference rate relative to the measured tilt."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cmg_mj.replay.lag import STRETCHES, Piece, jackknife_stretches, lag_with_error
from cmg_mj.results.stored_columns import stretches

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
    lag_error_s: float | None = None
    """Standard error of the lag [s]; these errors are jackknives over `STRETCHES` of the log."""
    scale_error: float | None = None
    """Standard error of the scale."""
    offset_error_rad_s: float | None = None
    """Standard error of the offset [rad/s]."""
    residual_rad: float | None = None
    """RMS of the tilt's increments less those of the fit [rad]."""


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
    rises = [_Rises(y, span) for y, _ in pieces]
    late = lag_with_error([_Travels(rate, span, dt, 0.0) for _, rate in pieces], rises, dt)
    lag_s, lag_error = late or (None, None)
    fit = _Fit.of(rises, [_Travels(rate, span, dt, lag_s or 0.0) for _, rate in pieces])
    line = fit and fit.line(fit.sums.sum(axis=0))
    if fit is None or line is None:
        return Alignment(lag_s, None, None, None)
    errors = fit.errors(span * dt)
    return Alignment(lag_s, line.slope, line.start / (span * dt), line.correlation, lag_error, *errors)


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


class _Line(NamedTuple):
    """A fitted line, rise = start + slope travel."""

    slope: float
    start: float
    correlation: float
    residual: float
    """RMS of the rises less the line."""


@dataclass(frozen=True)
class _Fit:
    """Sums over the stretches of a log, from which lines are fitted.

    Attributes:
        middle: Numbers that are subtracted from 1, travel and rise: sums of numbers near zero lose nothing, (3,).
        sums: Products of these, (`STRETCHES`, 3, 3).
    """

    middle: np.ndarray
    sums: np.ndarray

    @classmethod
    def of(cls, rises: Sequence[Piece], travels: Sequence[Piece]) -> _Fit | None:
        """Sum the known pairs; None if there are none."""
        sums, middle = np.zeros((STRETCHES, 3, 3)), None
        for number, piece, rows in jackknife_stretches([len(rise) for rise in rises], 0):
            for part in stretches(rows.stop - rows.start):
                some = slice(rows.start + part.start, rows.start + part.stop)
                pairs = np.stack([np.ones(part.stop - part.start), travels[piece][some], rises[piece][some]])
                pairs = pairs[:, np.isfinite(pairs[1])]
                if not pairs.shape[1]:
                    continue
                if middle is None:
                    middle = np.array([0.0, *pairs[1:].mean(axis=1)])
                pairs -= middle[:, None]
                sums[number] += pairs @ pairs.T
        return None if middle is None else cls(middle, sums)

    def line(self, sums: np.ndarray) -> _Line | None:
        """Fit a line to some sums, (3, 3); None if there is too little motion."""
        n = sums[0, 0]
        if n < 3:
            return None
        means = sums[0, 1:] / n
        (xx, xy), (_, yy) = sums[1:, 1:] - n * np.outer(means, means)
        rounding = n * (n * np.finfo(float).eps * (means + self.middle[1:])) ** 2
        if not xx > rounding[0] or not yy > rounding[1]:
            return None
        slope = xy / xx
        start = (means[1] + self.middle[2]) - slope * (means[0] + self.middle[1])
        residual = math.sqrt(max(0.0, yy - slope * xy) / n)
        return _Line(float(slope), float(start), float(xy / math.sqrt(xx * yy)), residual)

    def errors(self, span_s: float) -> tuple[float | None, float | None, float | None]:
        """Return standard errors of the slope and of the start by the span [rad/s], and the RMS of the residual."""
        whole = self.sums.sum(axis=0)
        line = self.line(whole)
        others = [self.line(whole - sums) for sums in self.sums if sums[0, 0]]
        known = [(other.slope, other.start / span_s) for other in others if other]
        if line is None or len(known) < max(2, len(others)):
            return None, None, line and line.residual
        slope, start = np.sqrt((len(known) - 1) * np.var(known, axis=0)).tolist()
        return slope, start, line.residual


def _travelled(rate: np.ndarray, span: int, dt: float, lag_s: float) -> np.ndarray:
    """Integrate a rate, shifted by its lag, over each span of samples; NaN where it is unknown, (n - span,)."""
    clock = np.arange(len(rate)) * dt
    steps = (rate[1:] + rate[:-1]) * dt / 2.0
    unknown = np.concatenate([[0], np.cumsum(np.isnan(steps))])
    travelled = np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])
    when = clock + lag_s
    travelled, unknown = (np.interp(when, clock, sums, left=np.nan, right=np.nan) for sums in (travelled, unknown))
    return np.where(unknown[span:] == unknown[:-span], travelled[span:] - travelled[:-span], np.nan)
