"""The reference beside the tilt: its lag, scale and offset."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.features.replay.log import REFERENCE, UNITS, Log
from cmg_mj.features.replay.noise import noise_remarks
from cmg_mj.features.replay.scores import STRETCHES, jackknife_error, jackknife_stretches, lag_with_error

SPAN_S = 0.2
"""Time over which increments of the tilt and of the integrated reference are compared [s]; slopes are mostly noise."""
OFF = 0.005
"""Deviation of the reference's scale from 1, or its offset by its RMS, from which it matters, if it is significant."""
SURE = 2.365
"""Standard errors of a 95 % interval: Student's, of the seven degrees of freedom of eight stretches."""
CLEAR = 4.03
"""Standard errors of a 99.5 % interval, which a deviation leaves that is reported: one of 20 faultless logs would leave
the other."""
LATE = 0.1
"""Lag from which it is reported, in periods of the log's rows or its samples, the longer of the two."""
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
    """Standard error of the lag [s]; these errors are jackknives over eighths of the log."""
    scale_error: float | None = None
    """Standard error of the scale."""
    offset_error_rad_s: float | None = None
    """Standard error of the offset [rad/s]."""


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
    sums, middle = np.zeros((STRETCHES, 3, 3)), np.zeros(3)
    for number, piece, rows in jackknife_stretches([len(rise) for rise in rises], 0):
        travel = _travelled(pieces[piece][1], span, dt, lag_s or 0.0, rows)
        pairs = np.stack([np.ones(len(travel)), travel, rises[piece][rows]])[:, np.isfinite(travel)]
        if not pairs.size:
            continue
        if not sums.any():
            middle[1:] = pairs[1:].mean(axis=1)  # sums of numbers near zero lose nothing
        pairs -= middle[:, None]
        sums[number] += pairs @ pairs.T
    whole = sums.sum(axis=0)
    line = _line(whole, middle, span * dt)
    if line is None:
        return Alignment(lag_s, None, None, None)
    errors = jackknife_error([_line(whole - stretch, middle, span * dt) for stretch in sums if stretch[0, 0]])
    return Alignment(lag_s, *line, lag_error, *(() if errors is None else errors[:2].tolist()))


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


def _line(sums: np.ndarray, middle: np.ndarray, length: float) -> tuple[float, float, float] | None:
    """Fit a line, rise = start + slope travel, to sums of products of 1, travel and rise.

    Args:
        sums: Sums, (3, 3).
        middle: Numbers that were subtracted, (3,).
        length: Time over which the tilt rises [s].

    Returns:
        Slope, start by the length, and correlation; None if there is too little motion.
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
    return float(slope), float(start) / length, float(xy / math.sqrt(xx * yy))


def alignment_of(log: Log, share: float = 1.0) -> Alignment | None:
    """Align a log's reference, up to a share of its largest, with its tilt.

    Returns:
        The alignment; None without a reference, and for a run's recording.
    """
    if "reference" not in log.has or log.scenario is not None:
        return None
    sizes = np.abs(log[REFERENCE])
    reference = np.where(sizes <= share * np.nanmax(sizes), log[REFERENCE], np.nan)
    tilts, references = ([values[part] for part in log.parts] for values in (log["y1_rad"], reference))
    return alignment(tilts, references, log.dt)


def judge(log: Log, aligned: Alignment) -> str:
    """Describe the reference's lag, scale and offset, with options that correct those that matter.

    Args:
        log: The log.
        aligned: Alignment from `alignment_of`.
    """
    lag, scale, offset, correlation, *errors = aligned
    if scale is None or offset is None or correlation is None:
        length = 2 * round(SPAN_S / log.dt) + 1
        known = (np.convolve(np.isfinite(log[REFERENCE][part]), np.ones(length)).max() for part in log.parts)
        why = "too little motion" if max(known) >= length else f"nowhere are both known for {2 * SPAN_S:g} s on end"
        return f"The reference cannot be compared with the tilt: {why}."
    lag_error, scale_error, offset_error = (math.inf if error is None else error for error in errors)
    options = log.options
    scale_set, offset_set = options.scale.get("rate", 1.0), options.offset.get("rate", 0.0)
    if correlation <= -AGREES or scale < -CLEAR * scale_error:
        return f"The reference counts the other way (correlation {correlation:.2f}): --scale rate={-scale_set:g}."
    if correlation < AGREES:
        return (
            f"Tilt and reference correlate by {correlation:.2f}: one is noisy, or is not of this motion. No delay or "
            "scale is offered."
        )
    fits = f"{_with_interval(scale, scale_error)} times the reference plus "
    fits += f"{_with_interval(offset, offset_error)} rad/s fits"
    comes, cures = "", []
    if lag is not None and abs(lag) > max(LATE * max(log.dt, log.row_period_s or 0.0), CLEAR * lag_error):
        comes = f"the reference comes {abs(lag) * 1e3:.4g} ms {'behind' if lag > 0.0 else 'before'}; "
        cures.append(f"--delay {options.delay_s + lag:.6g}")
    factor = 1.0
    if abs(scale - 1.0) > max(OFF, CLEAR * scale_error):
        small = alignment_of(log, 0.5)
        if (
            small
            and small.scale
            and abs(small.scale - scale) > CLEAR * math.hypot(small.scale_error or math.inf, scale_error)
        ):
            return (
                f"Beside the tilt {fits}, but {small.scale:.4f} times where it is small: it is clipped, or not linear. "
                "No scale is offered."
            )
        factor = scale
        cures.append(f"--scale rate={scale * scale_set:.4g}")
    motion = math.sqrt(float(np.nanmean(log[REFERENCE] ** 2)))
    shift = offset if abs(offset) > max(OFF * motion, CLEAR * offset_error) else 0.0
    if shift or (factor != 1.0 and offset_set):
        unit_size = UNITS["rate"][options.units.get("rate", "rad_s")]
        cures.append(f"--offset rate={factor * offset_set + shift / unit_size:.3g}")
    if cures:
        return f"Beside the tilt {comes}{fits} (to take it out: {' '.join(cures)})."
    return f"Tilt and reference agree: {fits}."


def remarks_on(log: Log, aligned: Alignment | None, noise: MeasurementNoise) -> list[str]:
    """Describe the changes to a log, its reference, and the noise that observers assume, in sentences."""
    lines = [f"{note[:1].upper()}{note[1:]}." for note in log.notes]
    return lines + ([] if aligned is None else [judge(log, aligned)]) + noise_remarks(log, noise)


def _with_interval(value: float, error: float) -> str:
    ends = (value, value - SURE * error, value + SURE * error)
    value, low, high = (round(number, 4) + 0.0 for number in ends)  # no -0.0000
    return f"{value:.4f} ({low:.4f} to {high:.4f})" if math.isfinite(error) else f"{value:.4f}"
