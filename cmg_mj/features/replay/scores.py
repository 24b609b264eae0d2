"""Scores of an estimated rate on a log: against the reference, or, without one, against the tilt."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from cmg_mj.features.replay.log import REFERENCE, Log
from cmg_mj.results.metrics import finite_or_none, fit
from cmg_mj.results.summary_keys import Figures
from cmg_mj.stages.push import inside

MAX_LAG_S = 0.5
"""Longest lag that is searched, and no longer than a quarter of the signal [s]."""
AS_GOOD = 0.98
"""A periodic motion fits itself every period: of peaks this close to the highest, the one nearest to no lag counts."""
ALIKE = 0.5
"""Lowest peak of the correlation: below, the reference explains less than a quarter of the estimate's variance."""
STRETCHES = 8
"""Stretches of the jackknife: each is omitted in turn, and the change of a figure shows its standard error."""
TAPS = 15
"""The correlation is smoothed over so many lags either way, if there are as many."""
RECONSTRUCTED_S = 1.0
"""Length of the stretches over which the estimated rate is integrated [s]."""

Piece = Callable[[slice], np.ndarray]
"""A signal that is computed a stretch at a time: successive samples, (n,)."""


def scores(log: Log, rate: np.ndarray, scored: np.ndarray, noise_gain: float | None) -> Figures:
    """Compute the figures of one estimate.

    Args:
        log: The log.
        rate: The estimate, (n,) [rad/s].
        scored: Which samples count, (n,).
        noise_gain: RMS of the rate that white noise of the tilt makes, by its size [1/s].

    Returns:
        The figures by the names that `--json` prints.
    """
    counted = [part.start + np.flatnonzero(scored[part]) for part in log.parts]
    pieces = [slice(rows[0], rows[-1] + 1) for rows in counted if len(rows)]
    figures = _against(log, rate, scored, pieces) if "reference" in log.has else _against_tilt(log, rate, pieces)
    return {**figures, "noise_gain_1_s": noise_gain}


def _against(log: Log, rate: np.ndarray, scored: np.ndarray, pieces: Sequence[slice]) -> Figures:
    true = log[REFERENCE]
    counted = scored & np.isfinite(true)
    behind, ahead = np.where(scored & np.isfinite(rate), rate, np.nan), np.where(scored, true, np.nan)
    error, motion = rms((rate - true)[counted]), rms(true[counted])
    figures = {
        "velocity_rms_error_rad_s": error,
        "velocity_rms_rad_s": motion,
        "velocity_fit": fit(error, motion),
        "lag_s": lag([behind[piece] for piece in pieces], [ahead[piece] for piece in pieces], log.dt),
    }
    if log.windows:
        counted &= inside(log["time_s"], log.windows)
        error, motion = rms((rate - true)[counted]), rms(true[counted])
        figures |= {"velocity_rms_error_push_rad_s": error, "velocity_fit_push": fit(error, motion)}
    return figures


def _against_tilt(log: Log, rate: np.ndarray, pieces: Sequence[slice]) -> Figures:
    """Compute the reconstruction error and the roughness of an estimate.

    For the first, the rate is integrated by the trapezoidal rule over `RECONSTRUCTED_S` at a time, each with the
    constant that fits best: the error over a second counts, not what a small offset becomes in an hour. The second is
    the size of the white noise whose second differences are as large as the estimate's.
    """
    span = max(2, round(RECONSTRUCTED_S / log.dt) + 1)
    errors, second = [], []
    for piece in pieces:
        y, r = log["y1_rad"][piece], rate[piece]
        second.append(np.diff(r, 2))
        for start in range(0, len(y) - span + 1, span - 1):
            part = slice(start, start + span)
            travelled = np.concatenate([[0.0], np.cumsum(r[part][1:] + r[part][:-1])]) * (log.dt / 2.0)
            error = travelled - y[part]
            errors.append(error - error.mean())
    off, rough = (rms(np.concatenate([*parts, []])) for parts in (errors, second))
    return {
        "reconstruction_rms_deg": None if off is None else math.degrees(off),
        "roughness_rad_s": None if rough is None else rough / math.sqrt(6.0),
    }


def rms(values: np.ndarray) -> float | None:
    """Return the RMS; None of no values, or if one is not finite."""
    if not len(values):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        return finite_or_none(math.sqrt(float(np.mean(values**2))))


def lag(behind: Sequence[np.ndarray], ahead: Sequence[np.ndarray], dt: float) -> float | None:
    """Find how long one signal comes after another: the peak of their correlation, between the samples too.

    For every whole number of samples the coefficient is that of all pairs there are. Before its peak is sought, all
    above a quarter of the sampling rate is taken out of it: what was folded down from above half the rate lies there,
    with its phase turned round, and between samples a curve is least sure of it. A quintic spline through the rest has
    its peak where a pure delay is, whatever the signals' sizes.

    Args:
        behind: Pieces of the later signal, each (n,); NaN where it is unknown.
        ahead: Pieces of the other signal at the same times.
        dt: Sample period [s].

    Returns:
        The lag [s], negative if the signal comes before the other. None for no motion, a low correlation (`ALIKE`), a
        peak at the end, or a standard error (jackknife over `STRETCHES`) above a sample and above half of the lag.
    """
    return lag_with_error([piece.__getitem__ for piece in behind], ahead, dt)[0]


def lag_with_error(
    behind: Sequence[Piece], ahead: Sequence[np.ndarray], dt: float
) -> tuple[float, float] | tuple[None, None]:
    """Find a lag as `lag` does, with its standard error [s]."""
    size = max((len(piece) for piece in ahead), default=0)
    reach = min(math.ceil(MAX_LAG_S / dt), (size - 1) // 4)
    if reach < 1:
        return None, None
    stretches = _sums(behind, ahead, reach)
    whole = stretches.sum(axis=0)
    peak = _peak_of(whole)
    error = jackknife_error([_peak_of(whole - stretch) for stretch in stretches if stretch[0].any()])
    if peak is None or error is None or error > max(1.0, abs(peak) / 2.0):
        return None, None
    return peak * dt, float(error) * dt


def _sums(behind: Sequence[Piece], ahead: Sequence[np.ndarray], reach: int) -> np.ndarray:
    """Sum counts, values, squares and products of the known pairs, (stretches, 6, lags)."""
    from scipy.signal import correlate

    # Numbers of like size: of the products of transforms, what is far smaller than the largest is lost.
    middle_x, middle_y = map(_mean, ([piece(slice(None)) for piece in behind], ahead))
    sums = np.zeros((STRETCHES, 6, 2 * reach + 1))
    for stretch, piece, rows in jackknife_stretches([len(piece) for piece in ahead], 2 * reach):
        around = slice(max(0, rows.start - reach), rows.stop + reach)
        x, y = behind[piece](around) - middle_x, ahead[piece][rows] - middle_y
        known_x, known_y = np.isfinite(x), np.isfinite(y)
        x, y = np.where(known_x, x, 0.0), np.where(known_y, y, 0.0)
        ones_x, ones_y = known_x.astype(float), known_y.astype(float)
        # x's row i is y's row i + around.start - rows.start.
        middle = len(y) - 1 + rows.start - around.start
        pairs = ((ones_x, ones_y), (x, ones_y), (ones_x, y), (x * x, ones_y), (ones_x, y * y), (x, y))
        for i, (a, b) in enumerate(pairs):
            sums[stretch, i] += np.pad(correlate(a, b, method="fft"), reach)[middle : middle + 2 * reach + 1]
    sums[:, 0] = np.rint(sums[:, 0])
    return sums


def _mean(pieces: Sequence[np.ndarray]) -> float:
    known = [values[np.isfinite(values)] for values in pieces]
    return sum(float(values.sum()) for values in known) / max(1, sum(map(len, known)))


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


def jackknife_error(others: Sequence[float | tuple[float, ...] | None]) -> np.ndarray | None:
    """Return the standard errors of figures by those without a stretch each; None if one of these is not known."""
    known = [other for other in others if other is not None]
    return None if len(known) < max(2, len(others)) else np.sqrt((len(known) - 1) * np.var(known, axis=0))


def _peak_of(sums: np.ndarray) -> float | None:
    """Return the lag at which the correlation coefficient has its peak, in samples."""
    n, sx, sy, sxx, syy, sxy = sums
    with np.errstate(all="ignore"):
        r = (sxy - sx * sy / n) / np.sqrt((sxx - sx * sx / n) * (syy - sy * sy / n))
    if not np.isfinite(r).all() or r.max() <= ALIKE:
        return None
    taps = min(TAPS, len(r) // 2 // 4)
    if taps >= 3:  # a low-pass at a quarter of the sampling rate; with few taps, none
        weights = np.sinc(np.arange(-taps, taps + 1) / 2.0) * np.kaiser(2 * taps + 1, 5.0)
        r = np.convolve(r, weights / weights.sum(), mode="valid")
    lags = np.arange(len(r)) - len(r) // 2
    peaks = [i for i in range(1, len(r) - 1) if r[i - 1] < r[i] >= r[i + 1] and r[i] >= AS_GOOD * r.max()]
    return _between(lags, r, min(peaks, key=lambda i: abs(lags[i]))) if peaks else None


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
