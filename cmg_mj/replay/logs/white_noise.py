"""White noise of a log's tilt and angular acceleration, from what is white in the file's own rows.

The rows' spectrum (Welch's, of rows less their motion) is compared from band to band below half the row rate. White
noise has the same density in all; a filter, a fusion or a quantiser leaves no such floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.replay.logs.resampling import EVEN
from cmg_mj.replay.logs.sampling import Part

SEGMENT = 128
"""Rows of a segment of Welch's spectrum; segments overlap by half, under Hann's window."""
TAPS = 32
CUTOFF = 0.29
"""The motion is a low-pass of so many rows to either side, with this cut-off in shares of half the row rate: 80 dB
below 0.2, nothing above 0.38."""
RESPONSE = 16
"""Rows for which an angular acceleration follows a command."""
FEWEST_RESPONSES = 20
"""Fewest rows to fit it, in times that."""
BANDS = np.arange(0.4, 0.95, 0.1)
"""Lower ends of the bands, each a tenth of half the row rate wide."""
FLOORS = ((0, 1.1), (2, 1.05))
"""First band of a floor, and the ratio of the largest to the smallest noise in it that still counts as white. A floor
of the upper four alone, above a faster motion, must be flatter: a filter falls least there."""
WALK = -np.log(np.sin(math.pi / 2.0 * (BANDS + 0.05)))
"""Logarithm of a random walk's density in the bands. No first-order filter and no fusion falls more steeply, so a floor
must be flatter than this; and what rises more steeply below a floor is motion."""
HANN = 0.947
"""Share of the rows' information that half-overlapping Hann windows keep."""
FEWEST = 1024
"""Fewest rows for an estimate, those counted for which `_without_motion` knows the motion."""
BLOCK = 16384
MOST_BLOCKS = 8
"""Blocks of rows, spread evenly, that a longer log gives."""
OUTLIER = 5.0
"""Segments with more than so many times the median power hold a spike or a blow, and do not count."""
FEW_OUTLIERS = 0.3
"""Largest share of such segments."""
COARSE = 0.6
"""Noise below this share of the smallest step between two values is the quantiser's: Sheppard's correction holds from
half a step on, to which a twelfth of the step's square is added."""
HARDLY = 1e-6
"""Noise below this share of the signal is rounding."""
UNITS = {"y1_rad": (math.pi / 180.0, "deg"), "acceleration_rad_s2": (1.0, "rad/s^2")}
"""Signal -> size and name of the unit in which it is printed."""
GROUPS = 16
"""Groups of segments whose scatter shows the error of the estimate, if it is larger than that of Gaussian noise."""


class WhiteNoise(NamedTuple):
    """Standard deviation of the white noise of one row, with its 95 % interval."""

    sigma: float
    low: float
    high: float


class LogNoise(NamedTuple):
    """White noise of one row of a file, or why it cannot be told."""

    tilt: WhiteNoise | str
    """Noise of the tilt [rad]."""
    acceleration: WhiteNoise | str | None
    """Noise of the angular acceleration [rad/s^2]; None without one."""
    correlation: float
    """Correlation of both; 0 where it cannot be told from 0."""


def white_noise_of(parts: Sequence[Part], period: float) -> LogNoise:
    """Estimate the white noise of a log's tilt and angular acceleration.

    Args:
        parts: The log's parts, with the file's own rows.
        period: Period of these rows [s].

    Returns:
        The noise of one row.
    """
    names = [name for name in ("y1_rad", "acceleration_rad_s2") if name in parts[0].rows]
    residuals: list[np.ndarray] = []
    steps, sizes = dict.fromkeys(names, math.inf), dict.fromkeys(names, 0.0)
    n_all, lead = 0, 0
    for places, values in _blocks(parts, period):
        n_all += len(places)
        for name in names:
            steps[name] = min(steps[name], _smallest_step(values[name]))
            sizes[name] = max(sizes[name], float(np.std(values[name])))
        if names[-1] == "acceleration_rad_s2" and "u_rad_s" in values:
            n_before = len(places)
            places, values = _without_response(places, values)
            lead = max(lead, n_before - len(places))
        if len(places) >= 2 * TAPS + SEGMENT:
            residuals.append(np.stack([_without_motion(places, values[name]) for name in names]))
    n_rows = sum(residual.shape[1] for residual in residuals)
    if n_rows < FEWEST:
        short = (
            f"it takes {FEWEST:,} rows, in parts of {2 * TAPS + SEGMENT + lead} or more, without the first "
            f"{TAPS + lead} and the last {TAPS} of each; of {n_all:,} rows {n_rows:,} are such"
        )
        return LogNoise(short, short if len(names) > 1 else None, 0.0)
    spectra = np.concatenate([_spectra(residual) for residual in residuals], axis=1)
    floors = [
        _floor(np.abs(spectrum) ** 2, steps[name], sizes[name], UNITS[name])
        for name, spectrum in zip(names, spectra, strict=True)
    ]
    tilt = floors[0]
    if len(names) == 1:
        return LogNoise(tilt, None, 0.0)
    acceleration = floors[1]
    if isinstance(tilt, str) or isinstance(acceleration, str):
        return LogNoise(tilt, acceleration, 0.0)
    return LogNoise(tilt, acceleration, _correlation(spectra))


def _blocks(parts: Sequence[Part], period: float) -> Iterator[tuple[np.ndarray, Mapping[str, np.ndarray]]]:
    """Yield blocks of successive rows: their places in periods, and their values."""
    blocks = [(p, start) for p in parts for start in range(0, len(p.placed), BLOCK)]
    few = np.unique(np.linspace(0, len(blocks) - 1, MOST_BLOCKS).round().astype(int))
    for part, start in blocks if len(blocks) <= MOST_BLOCKS else [blocks[i] for i in few]:
        rows = slice(start, start + BLOCK)
        placed = part.placed[rows]
        yield (placed - placed[0]) / period, {name: part.rows.read(name, rows) for name in part.rows}


def _smallest_step(values: np.ndarray) -> float:
    """Return the smallest distance of two different values."""
    steps = np.diff(np.sort(values))
    steps = steps[steps > 1e-9 * np.ptp(values)]
    return float(steps.min()) if len(steps) else math.inf


def _without_response(
    places: np.ndarray, values: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, Mapping[str, np.ndarray]]:
    """Subtract what the acceleration owes to the commands of the last rows, which go up to half the row rate too.

    A command knows the noise of rows before, and none of the rows after it: least squares on it alone leave white noise
    as it is. Gimbals turn a rig by the cosine of their angle.
    """
    acceleration, command = values["acceleration_rad_s2"], values["u_rad_s"] * np.cos(values.get("y2_rad", 0.0))
    n_rows = len(places) - RESPONSE
    if n_rows < FEWEST_RESPONSES * RESPONSE or np.abs(places - np.arange(len(places))).max() >= EVEN:
        return places, values
    before = np.stack([np.ones(n_rows), *(command[RESPONSE - k : -k] for k in range(1, RESPONSE + 1))], axis=1)
    rest = acceleration[RESPONSE:]
    for _ in range(2):  # the second time without what is far off, such as a push
        usual = np.abs(rest - np.median(rest))
        few = usual <= 8.0 * np.median(usual)
        response = np.linalg.lstsq(before[few], acceleration[RESPONSE:][few], rcond=None)[0]
        rest = acceleration[RESPONSE:] - before @ response
    rest *= math.sqrt(n_rows / (n_rows - RESPONSE))
    return places[RESPONSE:], {"y1_rad": values["y1_rad"][RESPONSE:], "acceleration_rad_s2": rest}


def _without_motion(places: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Subtract what a low-pass leaves of a signal, at the rows' own times; without `TAPS` rows at either end."""
    ends = np.arange(-TAPS, TAPS + 1)
    kernel = np.sinc(CUTOFF * ends) * np.kaiser(2 * TAPS + 1, 8.0)
    kernel /= kernel.sum()
    if np.abs(places - np.arange(len(places))).max() < EVEN:
        return values[TAPS:-TAPS] - np.convolve(values, kernel, mode="valid")
    from scipy.interpolate import CubicSpline

    grid = np.arange(int(places[-1]) + 1)
    motion = np.convolve(CubicSpline(places, values)(grid), kernel, mode="valid")
    inside = (places >= TAPS) & (places <= grid[-1] - TAPS)
    return values[inside] - CubicSpline(grid[TAPS:-TAPS], motion)(places[inside])


def _spectra(residual: np.ndarray) -> np.ndarray:
    """Return the transforms of overlapping segments, (n_signals, n_segments, n_frequencies), 1 of unit white noise."""
    window = np.sin(math.pi * (np.arange(SEGMENT) + 0.5) / SEGMENT) ** 2
    segments = np.lib.stride_tricks.sliding_window_view(residual, SEGMENT, axis=1)[:, :: SEGMENT // 2]
    return np.fft.rfft(segments * (window / math.sqrt(float(np.sum(window**2)))), axis=2)


def _columns(first: int) -> slice:
    """Select the frequencies from a band on, up to half the row rate without it."""
    return slice(round(BANDS[first] * SEGMENT / 2.0), SEGMENT // 2)


def _steady(power: np.ndarray) -> np.ndarray:
    """Select the segments without a spike, (n_segments,)."""
    sizes = power[:, _columns(FLOORS[-1][0])].mean(axis=1)
    return sizes <= OUTLIER * np.median(sizes)


def _floor(power: np.ndarray, step: float, size: float, unit: tuple[float, str]) -> WhiteNoise | str:
    """Return the white floor of a spectrum, or why there is none.

    Args:
        power: Squares of the transforms, (n_segments, n_frequencies).
        step: Smallest step between two values of the signal.
        size: Standard deviation of the signal.
        unit: Size and name of the unit in which to print the step.
    """
    steady = _steady(power)
    if steady.mean() < 1.0 - FEW_OUTLIERS:
        return "its size changes too much in the course of the log"
    power = power[steady]
    frequencies = np.arange(power.shape[1]) * 2.0 / SEGMENT
    bands = [power[:, (frequencies >= low) & (frequencies < low + 0.1) & (frequencies < 1.0)] for low in BANDS]
    levels = np.array([0.5 * math.log(max(float(band.mean()), 1e-300)) for band in bands])
    noise = None
    for first, tolerance in FLOORS:
        whole = power[:, _columns(first)]
        error = _error(whole, 1.0 - BANDS[first])
        each = error * math.sqrt(len(BANDS) - first)
        floor, order = levels[first:], np.arange(len(BANDS) - first)
        slope, slope_error = np.polyfit(order, floor, 1)[0], each / math.sqrt(len(order) * float(np.var(order)))
        drift, drift_error = slope * (len(order) - 1), slope_error * (len(order) - 1)
        allowed = math.log(tolerance)
        flat = np.ptp(floor) <= allowed + 4.7 * each and abs(drift) <= allowed + 2.6 * drift_error
        no_filter = -drift < WALK[first] - WALK[-1] - 2.0 * drift_error
        moves = first == 0 or levels[0] - levels[-1] > WALK[0] - WALK[-1] + 4.0 * each
        if flat and no_filter and moves:
            sigma = math.sqrt(float(whole.mean()))
            low, high = sigma * math.exp(-1.96 * error), sigma * math.exp(1.96 * error)
            if np.sum((floor - floor.mean()) ** 2) > (len(order) - 1 + 3.3 * math.sqrt(2 * len(order) - 2)) * each**2:
                low, high = min(low, math.exp(floor.min())), max(high, math.exp(floor.max()))
            noise = WhiteNoise(sigma, low, high)
            break
    top = math.sqrt(float(power[:, _columns(FLOORS[-1][0])].mean()))
    if top < HARDLY * size:
        return "there is hardly any"
    if top < COARSE * step < math.inf:
        steps = f"{step / unit[0]:.3g} {unit[1]}"
        return f"it goes in steps of {steps}, and noise below {COARSE:g} of a step is the quantiser's"
    if noise is None and levels[-1] < levels[:-1].max() - math.log(FLOORS[0][1]):
        return "its density falls off towards half the row rate, as of a filtered or fused signal: no white floor"
    return noise or "its density is not the same in the upper part of the band: no white floor"


def _error(power: np.ndarray, share: float) -> float:
    """Return the standard error of the noise's logarithm, from a share of the band."""
    n_rows = len(power) * SEGMENT / 2.0
    gaussian = 1.0 / math.sqrt(2.0 * HANN * share * n_rows)
    if len(power) < 4 * GROUPS:
        return gaussian
    means = np.array([group.mean() for group in np.array_split(power, GROUPS)])
    return max(gaussian, 0.5 * float(np.std(means, ddof=1) / means.mean()) / math.sqrt(GROUPS))


def _correlation(spectra: np.ndarray) -> float:
    """Return the correlation of two signals' white noise; 0 where it is not significant."""
    steady = _steady(np.abs(spectra[0]) ** 2) & _steady(np.abs(spectra[1]) ** 2)
    first = FLOORS[-1][0]
    a, b = spectra[:, steady, _columns(first)]
    power = float(np.sum(np.abs(a) ** 2)) * float(np.sum(np.abs(b) ** 2))
    correlation = float(np.sum((a * b.conj()).real)) / math.sqrt(power)
    known = HANN * (1.0 - BANDS[first]) * int(steady.sum()) * SEGMENT / 2.0
    return correlation if abs(correlation) > 3.0 / math.sqrt(known) else 0.0
