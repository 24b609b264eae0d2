"""The reference beside the tilt: its lag, scale and offset."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.features.replay.log import REFERENCE, UNITS, Log, WhiteNoise
from cmg_mj.features.replay.noise import noise_in, noise_remarks
from cmg_mj.features.replay.scores import STRETCHES, Piece, jackknife_error, jackknife_stretches, lag_with_error

SPAN_S = 0.2
"""Time over which increments of the tilt and of the integrated reference are compared [s]; slopes are mostly noise."""
OFF = 0.005
"""Deviation of the reference's scale from 1, or its offset by its RMS, from which it matters, if it is significant."""
NEAR = 0.05
"""Largest such deviation at which a reference that correlates less than `AGREES` still agrees."""
SURE = 2.365
"""Standard errors of a 95 % interval: Student's, of the seven degrees of freedom of eight stretches."""
CLEAR = 4.03
"""Standard errors of a 99.5 % interval, which a deviation leaves that is reported: one of 20 faultless logs would leave
the other."""
NOISE = 1.2
"""Ratio up to which the rest of the tilt is its white noise."""
LATE = 0.1
"""Lag from which it is reported, in periods of the log's rows or its samples, the longer of the two."""
FINE = 0.01
"""Step in which a delay is offered, at most, in the same periods."""
AGREES = 0.95
"""Correlation at the best lag, of either sign, from which a cure is offered. If the tilt freezes half-way, neither lag
nor scale is meaningful."""


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
    rises = [y[span:] - y[:-span] for y, _ in pieces]
    lag_s, lag_error = lag_with_error([partial(_travelled, rate, span, dt, 0.0) for _, rate in pieces], rises, dt)
    sums, middle = _pair_sums([partial(_travelled, rate, span, dt, lag_s or 0.0) for _, rate in pieces], rises)
    whole = sums.sum(axis=0)
    line = _line(whole, middle, span * dt)
    if line is None:
        return Alignment(lag_s, None, None, None)
    errors = jackknife_error([_line(whole - stretch, middle, span * dt) for stretch in sums if stretch[0, 0]])
    scale_error, offset_error = (None, None) if errors is None else errors[:2].tolist()
    scale, offset, correlation, residual = line
    return Alignment(lag_s, scale, offset, correlation, lag_error, scale_error, offset_error, residual)


def _travelled(rate: np.ndarray, span: int, dt: float, lag_s: float, rows: slice) -> np.ndarray:
    """Integrate a rate, shifted by its lag, over each span of samples; NaN where it is unknown, (n - span,)[rows]."""
    start, stop, _ = rows.indices(len(rate) - span)
    margin = math.ceil(abs(lag_s) / dt) + 2
    first = max(0, start - margin)
    rate = rate[first : stop + span + margin]
    clock = np.arange(len(rate)) * dt
    steps = (rate[1:] + rate[:-1]) * dt / 2.0
    travelled, unknown = (
        np.interp(clock + lag_s, clock, np.concatenate([[0.0], np.cumsum(values)]), left=np.nan, right=np.nan)
        for values in (np.nan_to_num(steps), np.isnan(steps))
    )
    known = unknown[span:] == unknown[:-span]
    return np.where(known, travelled[span:] - travelled[:-span], np.nan)[start - first : stop - first]


def _pair_sums(travels: Sequence[Piece], rises: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Sum the known pairs of each stretch of a log.

    Returns:
        Products of 1, travel and rise, less the following, (`STRETCHES`, 3, 3); numbers that are subtracted from the
        three, since sums of numbers near zero lose nothing, (3,).
    """
    sums, middle = np.zeros((STRETCHES, 3, 3)), np.zeros(3)
    for number, piece, rows in jackknife_stretches([len(rise) for rise in rises], 0):
        pairs = np.stack([np.ones(rows.stop - rows.start), travels[piece](rows), rises[piece][rows]])
        pairs = pairs[:, np.isfinite(pairs[1])]
        if not pairs.shape[1]:
            continue
        if not sums.any():
            middle = np.array([0.0, *pairs[1:].mean(axis=1)])
        pairs -= middle[:, None]
        sums[number] += pairs @ pairs.T
    return sums, middle


def _line(sums: np.ndarray, middle: np.ndarray, length: float) -> tuple[float, float, float, float] | None:
    """Fit a line, rise = start + slope travel, to sums of pairs.

    Args:
        sums: Sums, (3, 3).
        middle: Numbers that were subtracted, (3,).
        length: Time over which the tilt rises [s].

    Returns:
        Slope, start by the length, correlation, and RMS of the rises less the line; None if there is too little motion.
    """
    n = sums[0, 0]
    if n < 3:
        return None
    means = sums[0, 1:] / n
    (xx, xy), (_, yy) = sums[1:, 1:] - n * np.outer(means, means)
    rounding = n * (n * np.finfo(float).eps * (means + middle[1:])) ** 2
    if not xx > rounding[0] or not yy > rounding[1]:
        return None
    slope = xy / xx
    start = (means[1] + middle[2]) - slope * (means[0] + middle[1])
    residual = math.sqrt(max(0.0, yy - slope * xy) / n)
    return float(slope), float(start) / length, float(xy / math.sqrt(xx * yy)), residual


def alignment_of(log: Log) -> Alignment | None:
    """Align a log's reference with its tilt; None without a reference, and for a run's recording."""
    if "reference" not in log.has or log.scenario is not None:
        return None
    tilts, references = ([log[name][part] for part in log.parts] for name in ("y1_rad", REFERENCE))
    return alignment(tilts, references, log.dt)


def judge(log: Log, aligned: Alignment) -> str:
    """Describe the reference's lag, scale and offset, with options that correct those that matter.

    Args:
        log: The log.
        aligned: Alignment from `alignment_of`.
    """
    lag, scale, offset, correlation = aligned[:4]
    if scale is None or offset is None or correlation is None:
        return "The reference cannot be compared with the tilt: too little motion, or too short."
    *errors, residual = aligned[4:]
    lag_error, scale_error, offset_error = (math.inf if error is None else CLEAR * error for error in errors)
    noise, options = noise_in(log).tilt, log.options
    noisy = residual is not None and isinstance(noise, WhiteNoise) and residual <= NOISE * math.sqrt(2.0) * noise.high
    scale_set, offset_set = options.scale.get("rate", 1.0), options.offset.get("rate", 0.0)
    period = max(log.dt, log.row_period_s or 0.0)
    motion = math.sqrt(float(np.nanmean(log[REFERENCE] ** 2)))
    near = lag is not None and abs(lag) <= LATE * period and abs(scale - 1.0) <= NEAR and abs(offset) <= NEAR * motion
    not_alike = f"The reference does not go with the tilt (correlation {correlation:.2f})"
    if correlation <= -AGREES or (noisy and scale < -scale_error):
        return f"{not_alike}: it counts the other way: --scale rate={-scale_set:g}."
    if correlation < AGREES and not (noisy and scale > scale_error) and not near:
        return f"{not_alike}: is it the rate of this tilt, and do both move and not leap? No delay or scale is offered."
    late = lag is not None and abs(lag) > max(LATE * period, lag_error)
    resized = abs(scale - 1.0) > max(OFF, scale_error)
    shifted = abs(offset) > max(OFF * motion, offset_error)
    share = SURE / CLEAR
    fits = f"{_with_interval(scale, share * scale_error)} times the reference plus "
    fits += f"{_with_interval(offset, share * offset_error)} rad/s fits"
    if not (late or resized or shifted):
        return f"Tilt and reference agree: {fits}."
    decimals = max(0, math.ceil(-math.log10(FINE * period)))
    comes, cures = "", []
    if late and lag is not None:
        where = "behind" if lag > 0.0 else "before"
        comes = f"the reference comes {abs(lag) * 1e3:.{max(2, decimals - 3)}f} ms {where}; "
        cures.append(f"--delay {options.delay_s + lag:.{decimals}f}")
    factor = scale if resized else 1.0
    if resized:
        cures.append(f"--scale rate={factor * scale_set:.4g}")
    if shifted or (resized and offset_set):
        unit_size = UNITS["rate"][options.units.get("rate", "rad_s")]
        cures.append(f"--offset rate={factor * offset_set + (offset / unit_size if shifted else 0.0):.3g}")
    return f"Beside the tilt {comes}{fits} (to take it out: {' '.join(cures)})."


def remarks_on(log: Log, aligned: Alignment | None, noise: MeasurementNoise) -> list[str]:
    """Describe the changes to a log, its reference, and the noise that observers assume, in sentences."""
    lines = [f"{note[:1].upper()}{note[1:]}." for note in log.notes]
    return lines + ([] if aligned is None else [judge(log, aligned)]) + noise_remarks(log, noise)


def _with_interval(value: float, error: float) -> str:
    value, low, high = (round(number, 4) + 0.0 for number in (value, value - error, value + error))  # no -0.0000
    return f"{value:.4f} ({low:.4f} to {high:.4f})" if math.isfinite(error) else f"{value:.4f}"
