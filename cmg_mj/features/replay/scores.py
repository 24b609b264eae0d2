"""Scores of an estimated rate on a log: against the reference, or, without one, against the tilt.

The zero-phase smoother sees the future: no observer, but what an observer of the tilt could come near.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from cmg_mj.features.replay.log import REFERENCE, Log
from cmg_mj.results.metrics import finite_or_none, fit
from cmg_mj.stages.push import inside

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
RECONSTRUCTED_S = 1.0
"""Length of the stretches over which the estimated rate is integrated [s]."""
ZERO_PHASE = "zero_phase"
"""Name of the smoother's row among the figures."""
CUTOFFS = 80
"""Number of cut-offs that are tried, in equal ratios from the lowest to half the sampling rate."""
LOWEST_PERIODS = 2.0
"""The lowest cut-off has so many periods in the longest part."""
BLOCK, BLOCKS = 32768, 4
"""The cut-off of a long log is chosen on so many blocks of so many samples, evenly spread."""

Figures = dict[str, float | None]
"""Name -> figure; None where it does not exist."""


def scores(log: Log, rate: np.ndarray, scored: np.ndarray) -> Figures:
    """Compute the figures of one estimate.

    Args:
        log: The log.
        rate: The estimate, (n,) [rad/s].
        scored: Which samples count, (n,).

    Returns:
        The figures by the names that `--json` prints.
    """
    if "reference" in log.has:
        return _against(log, rate, scored)
    return {
        "reconstruction_rms_deg": reconstruction(log, rate, scored),
        "roughness_rad_s": roughness(log, rate, scored),
    }


def _against(log: Log, rate: np.ndarray, scored: np.ndarray) -> Figures:
    true = log[REFERENCE]
    counted = scored & np.isfinite(true)
    error, motion = _rms((rate - true)[counted]), _rms(true[counted])
    pieces, known = _pieces(log, scored), scored & np.isfinite(rate)
    behind, ahead = np.where(known, rate, np.nan), np.where(scored, true, np.nan)
    figures = {
        "velocity_rms_error_rad_s": error,
        "velocity_rms_rad_s": motion,
        "velocity_fit": fit(error, motion),
        "lag_s": lag([behind[piece] for piece in pieces], [ahead[piece] for piece in pieces], log.dt),
    }
    if log.windows:
        counted &= inside(log["time_s"], log.windows)
        error, motion = _rms((rate - true)[counted]), _rms(true[counted])
        figures |= {"velocity_rms_error_push_rad_s": error, "velocity_fit_push": fit(error, motion)}
    return figures


def reconstruction(log: Log, rate: np.ndarray, scored: np.ndarray) -> float | None:
    """Compute the RMS of the tilt integrated from an estimated rate less the measured tilt.

    The rate is integrated by the trapezoidal rule over `RECONSTRUCTED_S` at a time, each with the constant that fits
    best: the error over a second counts, not what a small offset becomes in an hour.

    Args:
        log: The log.
        rate: The estimate, (n,) [rad/s].
        scored: Which samples count, (n,).

    Returns:
        The error [deg]; None if no stretch is long enough.
    """
    span = max(2, round(RECONSTRUCTED_S / log.dt) + 1)
    errors = []
    for piece in _pieces(log, scored):
        y, r = log["y1_rad"][piece], rate[piece]
        for start in range(0, len(y) - span + 1, span - 1):
            part = slice(start, start + span)
            travelled = np.concatenate([[0.0], np.cumsum(r[part][1:] + r[part][:-1])]) * (log.dt / 2.0)
            error = travelled - y[part]
            errors.append(error - error.mean())
    return finite_or_none(math.degrees(_rms(np.concatenate(errors)) or 0.0)) if errors else None


def roughness(log: Log, rate: np.ndarray, scored: np.ndarray) -> float | None:
    """Compute the size of the white noise whose second differences are as large as an estimate's.

    Args:
        log: The log.
        rate: The estimate, (n,) [rad/s].
        scored: Which samples count, (n,).

    Returns:
        RMS of the second differences by sqrt(6) [rad/s].
    """
    second = [np.diff(rate[piece], 2) for piece in _pieces(log, scored)]
    rms = _rms(np.concatenate(second)) if second else None
    return None if rms is None else rms / math.sqrt(6.0)


def noise_gain(noisy: np.ndarray, clean: np.ndarray, size: float, scored: np.ndarray) -> float | None:
    """Compute the gain from white noise of the tilt to an estimated rate.

    Args:
        noisy: The rate with the noise, (n,).
        clean: The rate without it, (n,).
        size: Standard deviation of one sample of the noise [rad].
        scored: Which samples count, (n,).

    Returns:
        RMS of the response, divided by the size [1/s].
    """
    rms = _rms((noisy - clean)[scored])
    return None if rms is None or not size > 0.0 else rms / size


def _pieces(log: Log, scored: np.ndarray) -> list[slice]:
    """Return the scored slice of each part."""
    pieces = []
    for part in log.parts:
        counted = np.flatnonzero(scored[part])
        if len(counted):
            pieces.append(slice(part.start + int(counted[0]), part.start + int(counted[-1]) + 1))
    return pieces


def _rms(values: np.ndarray) -> float | None:
    """Return the RMS; None of no values, or if one is not finite."""
    if not len(values):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        return finite_or_none(math.sqrt(float(np.mean(values**2))))


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
        values = piece[:]
        known = values[np.isfinite(values)]
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


@dataclass(frozen=True)
class ZeroPhase:
    """Figures of the smoother on a log.

    Attributes:
        cutoff_hz: Its cut-off, chosen on the tilt alone [Hz].
        figures: Its figures, as those of an observer.
        best_cutoff_hz: The cut-off that fits the reference best [Hz].
        best_rms_error_rad_s: RMS error with that cut-off [rad/s].
    """

    cutoff_hz: float
    figures: Figures
    best_cutoff_hz: float
    best_rms_error_rad_s: float | None

    @property
    def remark(self) -> str:
        """Description of the row."""
        best = "-" if self.best_rms_error_rad_s is None else f"{self.best_rms_error_rad_s:.4f}"
        return (
            f"{ZERO_PHASE} is no observer: it sees the future. It smooths the tilt to both sides of each sample, below "
            f"{self.cutoff_hz:.3g} Hz, chosen by the tilt alone; with {self.best_cutoff_hz:.3g} Hz, the best for the "
            f"reference, its error is {best} rad/s."
        )


def zero_phase(log: Log, scored: np.ndarray) -> ZeroPhase | None:
    """Choose the smoother's cut-off on a log with a reference, and score it.

    Args:
        log: The log.
        scored: Which samples count, (n,).

    Returns:
        Its figures; None if all parts are shorter than four samples.
    """
    blocks = _blocks(log)
    if not blocks:
        return None
    cutoffs = _cutoffs(log)
    cutoff = chosen_cutoff([log["y1_rad"][rows] for rows in blocks], log.dt, cutoffs)
    best = _best_for_reference(log, blocks, scored, cutoffs)
    gain = noise_gain_of(cutoff, log.dt)
    figures = {**scores(log, rate_of_log(log, cutoff), scored), "noise_gain_1_s": gain}
    error = figures["velocity_rms_error_rad_s"]
    if best != cutoff:
        error = scores(log, rate_of_log(log, best), scored)["velocity_rms_error_rad_s"]
    return ZeroPhase(cutoff, figures, best, error)


def smoothed_rate(tilt: np.ndarray, dt: float, cutoff_hz: float) -> np.ndarray:
    """Return the rate of the smoothed tilt.

    The smoothed tilt x minimises, but for the ends, the sum of (x - y)^2 plus the integral of x'''^2 by
    (2 pi cutoff)^6: a smoothing spline, or the Rauch-Tung-Striebel smoother of an acceleration that is a random walk.
    Its response is 1/(1 + (f/cutoff)^6), as that of `scipy.signal.filtfilt` with a Butterworth filter of third order.
    It is applied in the frequency domain, the tilt less the line through its ends being continued oddly.

    Args:
        tilt: Successive samples, (n,) [rad].
        dt: Sample period [s].
        cutoff_hz: Where half of the amplitude is left [Hz].

    Returns:
        (n,) [rad/s].
    """
    n = len(tilt)
    spectrum = np.fft.rfft(_continued(tilt))
    frequency = np.fft.rfftfreq(2 * (n - 1), dt)
    spectrum *= 2j * math.pi * frequency / (1.0 + (frequency / cutoff_hz) ** 6)
    slope = (tilt[-1] - tilt[0]) / ((n - 1) * dt)
    return np.fft.irfft(spectrum, 2 * (n - 1))[:n] + slope


def _continued(tilt: np.ndarray) -> np.ndarray:
    """Continue the tilt less the line through its ends oddly to one period, (2 n - 2,)."""
    bent = tilt - np.linspace(tilt[0], tilt[-1], len(tilt))
    return np.concatenate([bent, -bent[-2:0:-1]])


def chosen_cutoff(pieces: Sequence[np.ndarray], dt: float, cutoffs: np.ndarray) -> float:
    """Choose a cut-off by generalised cross-validation, on the tilt alone.

    With the share R(f) = 1 - response that the smoother takes away, it minimises mean(R^2 |y|^2)/mean(R)^2: an
    estimate of the error at samples that the smoother is not shown. White noise in the tilt is assumed.

    Args:
        pieces: Pieces of the tilt, each (n,) [rad].
        dt: Sample period [s].
        cutoffs: Candidates, growing (m,) [Hz].

    Returns:
        One of them [Hz].
    """
    frequencies, powers = [], []
    for tilt in pieces:
        n = len(tilt)
        frequencies.append(np.fft.rfftfreq(2 * (n - 1), dt)[1:-1])
        powers.append(np.abs(np.fft.rfft(_continued(tilt))[1:-1]) ** 2 / n)
    frequency, power = np.concatenate(frequencies), np.concatenate(powers)
    risks = []
    for cutoff in cutoffs:
        taken = 1.0 / (1.0 + (cutoff / frequency) ** 6)
        risks.append(float(np.mean(taken**2 * power) / np.mean(taken) ** 2))
    return float(cutoffs[int(np.argmin(risks))])


def noise_gain_of(cutoff_hz: float, dt: float) -> float:
    """Return the size of the rate that white noise of the tilt leaves, by its size [1/s]."""
    frequency = (np.arange(4096) + 0.5) / 4096 * 0.5 / dt
    response = 2.0 * math.pi * frequency / (1.0 + (frequency / cutoff_hz) ** 6)
    return math.sqrt(float(np.mean(response**2)))


def rate_of_log(log: Log, cutoff_hz: float) -> np.ndarray:
    """Return the smoothed rate of a log, part by part, (n,) [rad/s]; NaN outside the parts."""
    rate = np.full(len(log), np.nan)
    for part in log.parts:
        rate[part] = smoothed_rate(log["y1_rad"][part], log.dt, cutoff_hz)
    return rate


def _cutoffs(log: Log) -> np.ndarray:
    """Return the candidates of a log's cut-off [Hz]."""
    longest = max(min(part.stop - part.start, BLOCK) for part in log.parts) * log.dt
    return np.geomspace(min(LOWEST_PERIODS / longest, 0.25 / log.dt), 0.5 / log.dt, CUTOFFS)


def _blocks(log: Log) -> list[slice]:
    """Return the blocks on which the cut-off is chosen: all of a short log."""
    blocks = [
        slice(start, min(start + BLOCK, part.stop))
        for part in log.parts
        for start in range(part.start, part.stop, BLOCK)
        if min(start + BLOCK, part.stop) - start >= 4
    ]
    if sum(block.stop - block.start for block in blocks) <= BLOCK * BLOCKS:
        return blocks
    return [blocks[i] for i in np.unique(np.linspace(0, len(blocks) - 1, BLOCKS).round().astype(int))]


def _best_for_reference(log: Log, blocks: Sequence[slice], scored: np.ndarray, cutoffs: np.ndarray) -> float:
    """Return the cut-off with the smallest error in some blocks [Hz]."""
    totals = np.zeros(len(cutoffs))
    for rows in blocks:
        tilt, reference = log["y1_rad"][rows], log[REFERENCE][rows]
        counted = scored[rows] & np.isfinite(reference)
        for i, cutoff in enumerate(cutoffs):
            error = (smoothed_rate(tilt, log.dt, float(cutoff)) - reference)[counted]
            totals[i] += float(np.sum(error**2))
    return float(cutoffs[int(np.argmin(totals))])
