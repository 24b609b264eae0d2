"""The lag of one signal behind another, finer than a sample."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from cmg_mj.results.stored_columns import stretches

LONGEST_LAG_S = 0.5
"""Longest lag that is searched, and no longer than a quarter of the signal [s]."""
AS_GOOD = 0.98
"""A periodic motion fits itself every period: of peaks this close to the highest, the one nearest to no lag counts."""
ALIKE = 0.5
"""Lowest peak of the correlation: below, the reference explains less than a quarter of the estimate's variance."""
STRETCHES = 8
"""Stretches of the jackknife: each is omitted in turn, and the change of the lag shows its standard error."""
TAPS = 15
"""The correlation is smoothed over so many lags either way, if there are as many."""


class Piece(Protocol):
    """A signal that may be computed a stretch at a time, such as an array."""

    def __len__(self) -> int:
        """Return the number of samples."""
        ...

    def __getitem__(self, rows: slice, /) -> np.ndarray:
        """Return successive samples."""
        ...


class Lag(NamedTuple):
    """A lag and its standard error [s]."""

    value: float
    error: float


def lag(
    behind: Sequence[Piece],
    ahead: Sequence[Piece],
    dt: float,
    longest_s: float = LONGEST_LAG_S,
) -> float | None:
    """Find how long one signal comes after another: the peak of their correlation, between the samples too.

    For every whole number of samples the coefficient is that of all pairs there are. Before its peak is sought, all
    above a quarter of the sampling rate is taken out of it: what was folded down from above half the rate lies there,
    with its phase turned round, and between samples a curve is least sure of it. A quintic spline through the rest has
    its peak where a pure delay is, whatever the signals' sizes.

    Args:
        behind: Pieces of the later signal, each (n,); NaN where it is unknown.
        ahead: Pieces of the other signal at the same times.
        dt: Sample period [s].
        longest_s: Longest lag that is searched, either way [s].

    Returns:
        The lag [s], negative if the signal comes before the other. None for no motion, a low correlation (`ALIKE`), a
        peak at the end, or a standard error (jackknife over `STRETCHES`) above a sample and above half of the lag.
    """
    result = lag_with_error(behind, ahead, dt, longest_s)
    return None if result is None else result.value


def lag_with_error(
    behind: Sequence[Piece],
    ahead: Sequence[Piece],
    dt: float,
    longest_s: float = LONGEST_LAG_S,
) -> Lag | None:
    """Find a lag as `lag` does, with its standard error."""
    size = max((len(piece) for piece in behind), default=0)
    reach = min(math.ceil(longest_s / dt), (size - 1) // 4)
    if reach < 1:
        return None
    stretches = _sums(behind, ahead, reach)
    whole = stretches.sum(axis=0)
    peak = _peak_of(whole)
    if peak is None:
        return None
    others = [_peak_of(whole - stretch) for stretch in stretches if stretch[0].any()]
    known = np.array([other for other in others if other is not None])
    if len(known) < max(2, len(others)):
        return None
    error = math.sqrt((len(known) - 1) * float(np.var(known)))
    return Lag(peak * dt, error * dt) if error <= max(1.0, abs(peak) / 2.0) else None


def _sums(behind: Sequence[Piece], ahead: Sequence[Piece], reach: int) -> np.ndarray:
    """Sum counts, values, squares and products of the known pairs, (stretches, 6, lags)."""
    from scipy.signal import correlate

    # Numbers of like size: of the products of transforms, what is far smaller than the largest is lost.
    middle_x, middle_y = _mean(behind), _mean(ahead)
    sums = np.zeros((STRETCHES, 6, 2 * reach + 1))
    for stretch, piece, rows in jackknife_stretches([len(piece) for piece in behind], 2 * reach):
        around = slice(max(0, rows.start - reach), rows.stop + reach)
        x, y = behind[piece][around] - middle_x, ahead[piece][rows] - middle_y
        known_x, known_y = np.isfinite(x), np.isfinite(y)
        x, y = np.where(known_x, x, 0.0), np.where(known_y, y, 0.0)
        ones_x, ones_y = known_x.astype(float), known_y.astype(float)
        # x's row i is y's row i + around.start - rows.start.
        middle = len(y) - 1 + rows.start - around.start
        first, last = max(0, middle - reach), min(len(x) + len(y) - 1, middle + reach + 1)
        into = slice(first - middle + reach, last - middle + reach)
        pairs = ((ones_x, ones_y), (x, ones_y), (ones_x, y), (x * x, ones_y), (ones_x, y * y), (x, y))
        for i, (a, b) in enumerate(pairs):
            sums[stretch, i, into] += correlate(a, b, mode="full", method="fft")[first:last]
    sums[:, 0] = np.rint(sums[:, 0])
    return sums


def _mean(pieces: Sequence[Piece]) -> float:
    total, count = 0.0, 0
    for piece in pieces:
        for rows in stretches(len(piece)):
            some = piece[rows]
            known = some[np.isfinite(some)]
            total, count = total + float(known.sum()), count + len(known)
    return total / count if count else 0.0


def jackknife_stretches(sizes: Sequence[int], least: int) -> Iterator[tuple[int, int, slice]]:
    """Cut all pieces longer than the least into `STRETCHES` of equal size: stretch, piece and its rows."""
    total, before = sum(size for size in sizes if size > least), 0
    edges = [round(total * k / STRETCHES) for k in range(STRETCHES + 1)]
    for piece, size in enumerate(sizes):
        if size <= least:
            continue
        for stretch in range(STRETCHES):
            start, stop = max(edges[stretch] - before, 0), min(edges[stretch + 1] - before, size)
            if start < stop:
                yield stretch, piece, slice(start, stop)
        before += size


def _peak_of(sums: np.ndarray) -> float | None:
    """Return the lag at which the correlation coefficient has its peak, in samples."""
    n, sx, sy, sxx, syy, sxy = sums
    with np.errstate(all="ignore"):
        r = (sxy - sx * sy / n) / np.sqrt((sxx - sx * sx / n) * (syy - sy * sy / n))
    if not np.isfinite(r).all() or r.max() <= ALIKE:
        return None
    reach = len(r) // 2
    r = np.convolve(r, _half_band(min(TAPS, reach // 4)), mode="valid")
    lags = np.arange(len(r)) - len(r) // 2
    peaks = [i for i in range(1, len(r) - 1) if r[i - 1] < r[i] >= r[i + 1] and r[i] >= AS_GOOD * r.max()]
    return _between(lags, r, min(peaks, key=lambda i: abs(lags[i]))) if peaks else None


def _half_band(taps: int) -> np.ndarray:
    """Return a symmetric low-pass at a quarter of the sampling rate, (2 taps + 1,); with few taps, no filter."""
    if taps < 3:
        return np.ones(1)
    places = np.arange(-taps, taps + 1)
    weights = np.sinc(places / 2.0) * np.kaiser(2 * taps + 1, 5.0)
    return weights / weights.sum()


def _between(lags: np.ndarray, r: np.ndarray, at: int) -> float:
    """Return where a curve through the samples is highest, in samples."""
    from scipy.interpolate import make_interp_spline
    from scipy.optimize import minimize_scalar

    around = slice(max(0, at - 8), at + 9)
    if len(r[around]) < 6:
        return float(lags[at])
    curve = make_interp_spline(lags[around], r[around], k=5)
    ends = (lags[at] - 1, lags[at] + 1)
    result = minimize_scalar(lambda m: -curve(m), bounds=ends, method="bounded", options={"xatol": 1e-7})
    return float(result.x)  # pyright: ignore[reportAttributeAccessIssue]
