"""The tilt rate of a smoother that sees the future: no observer, but what an observer of the tilt could come near."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.log import REFERENCE
from cmg_mj.replay.scores import Figures, scores
from cmg_mj.results.stored_columns import select_rows, stretches

ZERO_PHASE = "zero_phase"
"""Name of the smoother's row among the figures."""
CUTOFFS = 80
"""Number of cut-offs that are tried, in equal ratios from the lowest to half the sampling rate."""
LOWEST_PERIODS = 2.0
"""The lowest cut-off has so many periods in the longest part."""
BLOCK, BLOCKS = 32768, 4
"""The cut-off of a long log is chosen on so many blocks of so many samples, evenly spread."""
DECAYS = 25.0
"""A stretch is smoothed with neighbours on either side as far as the smoother's memory, so many time constants."""
AT_THE_END = 0.98
"""Share of half the sampling rate above which a cut-off takes nothing away."""


@dataclass(frozen=True)
class ZeroPhase:
    """Figures of the smoother on a log.

    Attributes:
        cutoff_hz: Its cut-off, chosen on the tilt alone [Hz].
        figures: Its figures, as those of an observer.
        best_cutoff_hz: The cut-off that fits the reference best [Hz].
        best_rms_error_rad_s: RMS error with that cut-off [rad/s].
        smooths: Whether the tilt has a white noise that the smoother takes away.
    """

    cutoff_hz: float
    figures: Figures
    best_cutoff_hz: float
    best_rms_error_rad_s: float | None
    smooths: bool

    def remark(self, doubt: str | None = None) -> str:
        """Say what the row is.

        Args:
            doubt: Why its distance from an observer is not the price of causality; None where it is.
        """
        how = f"smooths the tilt to both sides of each sample, below {self.cutoff_hz:.3g} Hz, chosen by the tilt alone"
        if not self.smooths:
            how += " (where no white noise could be told, so hardly at all)"
        best = "-" if self.best_rms_error_rad_s is None else f"{self.best_rms_error_rad_s:.4f}"
        price = "What an observer of the tilt alone lacks to it is the price of causality."
        if doubt is not None:
            price = f"What causality costs cannot be read off it here: {doubt}."
        return (
            f"{ZERO_PHASE} is no observer: it sees the future. It {how}; with {self.best_cutoff_hz:.3g} Hz, the best "
            f"for the reference, its error is {best} rad/s. {price}"
        )


def zero_phase(log: Log, scored: np.ndarray) -> ZeroPhase | None:
    """Choose the smoother's cut-off on a log with a reference, and score it.

    Args:
        log: The log.
        scored: Which samples count, (n,).

    Returns:
        Its figures; None if all parts are shorter than four samples.
    """
    blocks = list(_blocks(log))
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
    return ZeroPhase(cutoff, figures, best, error, cutoff < AT_THE_END * 0.5 / log.dt)


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
    """Return the smoothed rate of a log, part by part; of a long one stretch by stretch, each with its surroundings.

    Args:
        log: The log.
        cutoff_hz: The cut-off [Hz].

    Returns:
        (n,) [rad/s], NaN outside the parts.
    """
    rate = np.full(len(log), np.nan)
    margin = math.ceil(DECAYS / (math.pi * cutoff_hz * log.dt))  # the slowest pole of three is at half the cut-off
    for part in log.parts:
        for some in stretches(part.stop - part.start):
            rows = slice(part.start + some.start, part.start + some.stop)
            around = slice(max(part.start, rows.start - margin), min(part.stop, rows.stop + margin))
            tilt = select_rows(log.columns, around)["y1_rad"]
            smooth = smoothed_rate(tilt, log.dt, cutoff_hz)
            rate[rows] = smooth[rows.start - around.start : rows.stop - around.start]
    return rate


def _cutoffs(log: Log) -> np.ndarray:
    """Return the candidates of a log's cut-off [Hz]."""
    longest = max(min(part.stop - part.start, BLOCK) for part in log.parts) * log.dt
    return np.geomspace(min(LOWEST_PERIODS / longest, 0.25 / log.dt), 0.5 / log.dt, CUTOFFS)


def _blocks(log: Log) -> Iterator[slice]:
    """Return the blocks on which the cut-off is chosen: all parts of a short log."""
    pieces = [
        slice(part.start + some.start, part.start + some.stop)
        for part in log.parts
        for some in stretches(part.stop - part.start, BLOCK)
        if some.stop - some.start >= 4
    ]
    if sum(piece.stop - piece.start for piece in pieces) <= BLOCK * BLOCKS:
        return iter(pieces)
    longest = sorted(pieces, key=lambda piece: piece.start - piece.stop)[: max(BLOCKS, len(pieces) // 2)]
    spread = np.linspace(0, len(longest) - 1, BLOCKS).round().astype(int)
    ordered = sorted(longest, key=lambda piece: piece.start)
    return iter([ordered[i] for i in dict.fromkeys(spread.tolist())])


def _best_for_reference(log: Log, blocks: Sequence[slice], scored: np.ndarray, cutoffs: np.ndarray) -> float:
    """Return the cut-off with the smallest error in some blocks [Hz]."""
    totals = np.zeros(len(cutoffs))
    for rows in blocks:
        columns = select_rows(log.columns, rows)
        tilt, reference = columns["y1_rad"], columns[REFERENCE]
        counted = scored[rows] & np.isfinite(reference)
        for i, cutoff in enumerate(cutoffs):
            error = (smoothed_rate(tilt, log.dt, float(cutoff)) - reference)[counted]
            totals[i] += float(np.sum(error**2))
    return float(cutoffs[int(np.argmin(totals))])
