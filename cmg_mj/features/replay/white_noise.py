"""White noise of a log's tilt and angular acceleration.

The spectrum of the file's own rows (Welch's, of rows less their motion) is compared from band to band below half the
row rate. White noise has the same density in all; a filter, a fusion or a quantiser leaves no such floor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from cmg_mj.features.replay.log import EVEN, LogNoise, Segment, Values, WhiteNoise

SEGMENT = 128
"""Rows of a segment of Welch's spectrum; segments overlap by half, under Hann's window."""
TAPS = 32
CUTOFF = 0.29
"""The motion is a low-pass of so many rows to either side, with this cut-off in shares of half the row rate: 80 dB
below 0.2, nothing above 0.38."""
RESPONSE = 16
"""Rows for which an angular acceleration follows a command."""
MIN_RESPONSES = 20
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
MIN_ROWS = 1024
"""Fewest rows for an estimate, those counted for which `without_motion` knows the motion."""
BLOCK = 16384
MAX_BLOCKS = 8
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
AGREEING = 16384
"""Samples of a segment of the spectrum in which tilt and acceleration are compared."""
GROUPS = 16
"""Groups of segments whose scatter shows the error of the estimate, if it is larger than that of Gaussian noise."""


def white_noise_of(segments: Sequence[Segment], period: float, dt: float, correlation: float = 0.0) -> LogNoise:
    """Estimate the white noise of a log's tilt and angular acceleration.

    Resampling to a quicker rate keeps the density at low frequencies: white noise of that density is larger, sample for
    sample, than that of the rows. A spline at a slower rate lets all of a row's noise through.

    Args:
        segments: The log's segments, with the file's own rows.
        period: Period of these rows [s].
        dt: Sample period [s].
        correlation: Of both by the accelerometers' places, where no white floor shows it.

    Returns:
        The noise of one sample.
    """
    names = [name for name in ("y1_rad", "acceleration_rad_s2") if name in segments[0].rows]
    residuals: list[np.ndarray] = []
    steps, sizes = [], []
    blocks = [(one, start) for one in segments for start in range(0, len(one.placed), BLOCK)]
    for i in np.unique(np.linspace(0, len(blocks) - 1, min(len(blocks), MAX_BLOCKS)).round().astype(int)):
        segment, start = blocks[i]
        rows = slice(start, start + BLOCK)
        places = (segment.placed[rows] - segment.placed[start]) / period
        values = {name: column[rows] for name, column in segment.rows.items()}
        steps.append([smallest_step(values[name]) for name in names])
        sizes.append([float(np.std(values[name])) for name in names])
        if len(names) > 1 and "u_rad_s" in values:
            places, values = _without_response(places, values)
        if len(places) >= 2 * TAPS + SEGMENT:
            residuals.append(np.stack([without_motion(places, values[name]) for name in names]))
    n_rows = sum(residual.shape[1] for residual in residuals)
    if n_rows < MIN_ROWS:
        short = f"it takes {MIN_ROWS:,} rows, without the first and the last {TAPS} of each part; there are {n_rows:,}"
        return LogNoise(short, short if len(names) > 1 else None, 0.0)
    spectra = np.concatenate([transforms(residual) for residual in residuals], axis=1)
    factor = math.sqrt(max(1.0, period / dt))
    ends = (np.abs(spectra) ** 2, np.min(steps, axis=0), np.max(sizes, axis=0))
    tilt, acceleration, *_ = [*map(partial(white_floor, factor), *ends), None]
    if all(isinstance(noise, WhiteNoise) and not noise.doubt for noise in (tilt, acceleration)):
        return LogNoise(tilt, acceleration, _correlation(spectra))
    if acceleration is not None:
        return LogNoise(*_agreeing(segments, dt, correlation), correlation)
    return LogNoise(tilt, None, 0.0)


def _agreeing(segments: Sequence[Segment], dt: float, correlation: float) -> tuple[WhiteNoise, WhiteNoise]:
    """Find the white noises with which tilt and acceleration agree, whatever the motion.

    Where the acceleration runs straight between samples, the motion cancels in the second difference of y1 less h^2/6
    (a- + 4 a + a+), and the noise v of y1 and n of a leave, at the frequency w,

        (2 - 2 cos w)^2 vv + (h^2 (4 + 2 cos w)/6)^2 nn + 2 (2 - 2 cos w) h^2 (4 + 2 cos w)/6 vn.

    Both are the likeliest (P. Whittle, "Estimation and information in stationary time series", Arkiv for Matematik 2,
    1953). What else keeps the two signals apart, such as vibration or a delay, counts as their noise.
    """
    from scipy.optimize import minimize
    from scipy.signal import welch

    pieces = [(one.values["y1_rad"], one.values["acceleration_rad_s2"]) for one in segments]
    rests = [np.diff(y, 2) - dt * dt / 6.0 * (a[2:] + 4.0 * a[1:-1] + a[:-2]) for y, a in pieces]
    length = min(AGREEING, max(map(len, rests)))
    powers = [welch(rest, nperseg=length, window="hann")[1] for rest in rests if len(rest) >= length]
    power = np.average(powers, axis=0, weights=[len(rest) for rest in rests if len(rest) >= length])[3:]
    cosine = np.cos(2.0 * math.pi * np.arange(3, len(power) + 3) / length)
    of_tilt, of_acceleration = 2.0 - 2.0 * cosine, dt * dt * (4.0 + 2.0 * cosine) / 6.0

    def shares(sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the density by these noises' logarithms, and its parts by each."""
        v, n = of_tilt * math.exp(sizes[0]), of_acceleration * math.exp(sizes[1])
        parts = 2.0 * np.stack([v * v + correlation * v * n, n * n + correlation * v * n])
        return parts.sum(axis=0), parts

    def unlikely(sizes: np.ndarray) -> float:
        model, _ = shares(sizes)
        return float(np.sum(np.log(model) + power / model))

    top = math.sqrt(float(power[-len(power) // 4 :].mean()) / 32.0) + 1e-12
    start = np.log([top, math.sqrt(float(power[: len(power) // 8].mean()) / 2.0) / dt**2 + 1e-12])
    found = minimize(unlikely, start, method="Nelder-Mead").x
    model, parts = shares(found)
    slopes = 2.0 * parts / model  # of the density's logarithm by both noises': Fisher's information
    n_segments = sum(map(len, rests)) / length / 1.94  # neighbours behind Hann's window correlate
    variances = np.diag(np.linalg.pinv(n_segments * slopes @ slopes.T))
    errors = 1.96 * np.sqrt(np.maximum(variances, 0.0))  # rounding may be below, where there is no noise
    tilt, acceleration = (
        WhiteNoise(*np.exp(size + error * np.array([0, -1, 1])).tolist())
        for size, error in zip(found, errors, strict=True)
    )
    return tilt, acceleration


def smallest_step(values: np.ndarray) -> float:
    """Return the smallest distance of two different values."""
    steps = np.diff(np.sort(values))
    steps = steps[steps > 1e-9 * steps.sum()]
    return float(steps.min()) if len(steps) else math.inf


def _without_response(places: np.ndarray, values: Values) -> tuple[np.ndarray, Values]:
    """Subtract what the acceleration owes to the commands of the last rows, which go up to half the row rate too.

    A command knows the noise of rows before, and none of the rows after it: least squares on it alone leave white noise
    as it is. Gimbals turn a rig by the cosine of their angle.
    """
    acceleration, command = values["acceleration_rad_s2"], values["u_rad_s"] * np.cos(values.get("y2_rad", 0.0))
    n_rows = len(places) - RESPONSE
    if n_rows < MIN_RESPONSES * RESPONSE or np.abs(places - np.arange(len(places))).max() >= EVEN:
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


def without_motion(places: np.ndarray, values: np.ndarray) -> np.ndarray:
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


def transforms(residual: np.ndarray) -> np.ndarray:
    """Return the transforms of overlapping segments, (n_signals, n_segments, n_frequencies), 1 of unit white noise."""
    window = np.sin(math.pi * (np.arange(SEGMENT) + 0.5) / SEGMENT) ** 2
    segments = np.lib.stride_tricks.sliding_window_view(residual, SEGMENT, axis=1)[:, :: SEGMENT // 2]
    return np.fft.rfft(segments * (window / math.sqrt(float(np.sum(window**2)))), axis=2)


def upper_columns(first: int) -> slice:
    """Select the frequencies from a band on, up to half the row rate without it."""
    return slice(round(BANDS[first] * SEGMENT / 2.0), SEGMENT // 2)


def steady_segments(power: np.ndarray) -> np.ndarray:
    """Select the segments without a spike, (n_segments,)."""
    sizes = power[:, upper_columns(FLOORS[-1][0])].mean(axis=1)
    return sizes <= OUTLIER * np.median(sizes)


def white_floor(factor: float, power: np.ndarray, step: float, size: float) -> WhiteNoise | str:
    """Return the white floor of a spectrum, or why there is none.

    Args:
        factor: Noise of a sample by that of a row.
        power: Squares of the transforms, (n_segments, n_frequencies).
        step: Smallest step between two values of the signal.
        size: Standard deviation of the signal.
    """
    steady = steady_segments(power)
    if steady.mean() < 1.0 - FEW_OUTLIERS:
        return "its size changes too much in the course of the log"
    power = power[steady]
    top = math.sqrt(float(power[:, upper_columns(FLOORS[-1][0])].mean()))
    if top < HARDLY * size:
        return "there is hardly any"
    if top < COARSE * step < math.inf:
        steps = step / math.sqrt(12.0)
        return WhiteNoise(steps, steps, steps, f"it is below {COARSE:g} of the signal's smallest step")
    frequencies = np.arange(power.shape[1]) * 2.0 / SEGMENT
    bands = [power[:, (frequencies >= low) & (frequencies < low + 0.1) & (frequencies < 1.0)] for low in BANDS]
    levels = np.array([0.5 * math.log(max(float(band.mean()), 1e-300)) for band in bands])
    for first, tolerance in FLOORS:
        whole = power[:, upper_columns(first)]
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
            return WhiteNoise(factor * sigma, factor * low, factor * high)
    doubt = "there is no white floor below half the row rate, as of a filtered or fused signal"
    sigma = factor * top
    return WhiteNoise(sigma, sigma, sigma, doubt)


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
    steady = steady_segments(np.abs(spectra[0]) ** 2) & steady_segments(np.abs(spectra[1]) ** 2)
    first = FLOORS[-1][0]
    a, b = spectra[:, steady, upper_columns(first)]
    power = float(np.sum(np.abs(a) ** 2)) * float(np.sum(np.abs(b) ** 2))
    correlation = float(np.sum((a * b.conj()).real)) / math.sqrt(power)
    known = HANN * (1.0 - BANDS[first]) * int(steady.sum()) * SEGMENT / 2.0
    return correlation if abs(correlation) > 3.0 / math.sqrt(known) else 0.0
