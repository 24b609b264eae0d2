"""Sampling of a log's rows: their pace, their gaps, and the even grid that they are put on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from cmg_mj.core.errors import InputError, counted
from cmg_mj.features.replay.log import EVEN, UNITS, ReadOptions, Segment, Values

SAME_PERIOD = 1e-3
"""Relative difference up to which the line through the rows has their period."""
GAP_PERIODS = 1.5
"""A gap is longer than so many periods."""
PACKET = 1.75
"""Rows with longer usual steps between them, in their mean, come in packets: what is between is not known."""
LOST = 1.25
"""Mean step, in periods, up to which single rows are lost."""
TIGHT = 0.13
"""A spline through rows that are closer, in gaps, swings far beyond them: 0.2 periods."""
PAUSE = 3.0
"""Longer steps, in usual ones between packets, are pauses."""
ALIKE = 1.5
"""Mean change of a signal and its slope across long steps, in that across short ones, up to which rows are even."""
MIN_SAMPLES = 20
"""A segment with fewer samples is discarded."""
BRIDGED = 5
"""Longest gap that is bridged by default, in rows."""
FEW_REPEATED = 0.05
"""Share of rows with the stamp of the row before, up to which these rows are discarded; more are a mistake."""
SAME_TIME = 1e-6
"""Distance of two rows, in usual steps, up to which they have the same time."""
MIN_RATE_HZ, MAX_RATE_HZ = 0.1, 1e6
MAX_BALANCED_HZ = 2e4
"""Rate above which no log of such a rig is sampled [Hz]."""
MAX_SAMPLES = 5_000_000
"""More samples of a log take hours."""
HELD = "u_rad_s"
"""The signal that holds until the next row."""


def unrounded(time: np.ndarray, angle: np.ndarray, notes: list[str]) -> np.ndarray:
    """Put stamps that are rounded to most of a period on the even grid that they show, (n_rows,) [s].

    Rounding makes every m-th step, more or less by one, twice as long. Lost rows do so at random, or the tilt moves
    more across them.
    """
    steps, sizes = np.diff(time), np.abs(np.diff(angle))
    unit = np.median(steps)
    longer, usual = np.abs(steps - 2.0 * unit) < EVEN * unit, steps < 2.1 * unit
    if longer.sum() < MIN_SAMPLES or unit > (1.0 + EVEN) * _resolution(time):
        return time
    every = np.quantile(np.diff(np.flatnonzero(longer)), [0.1, 0.9])
    if np.ptp(every) > 2.0 or sizes[longer].mean() > ALIKE * sizes[~longer].mean():
        return time
    period = steps[usual].mean()
    notes.append(f"steps of {1e3 * unit:.3g} and {2e3 * unit:.3g} ms taken as even sampling at {1.0 / period:.6g} Hz")
    return time - np.cumsum([0.0, *np.where(usual, steps - period, 0.0)])


def sample(
    path: Path, time: np.ndarray, measured: Values, options: ReadOptions, slowest: float, notes: list[str]
) -> tuple[float, float, list[Segment]]:
    """Divide the complete rows at long gaps, and resample them if they are uneven.

    Args:
        path: The file, for messages.
        time: Stamps, (n_rows,) [s].
        measured: Name -> values, (n_rows,).
        options: The rate to resample to, and the longest gap.
        slowest: Lowest rate of rows; without a unit of the times milliseconds are not taken as seconds [Hz].
        notes: Takes what was changed.

    Returns:
        The period of the rows [s], that of the samples [s], and the segments.
    """
    time, values = _complete(path, time, measured, notes)
    steps = np.diff(time)
    period, between = _pace(steps, np.diff(values["y1_rad"]))
    gap = GAP_PERIODS * period
    cure = f"leave time out and give --rate {1.0 / period:.4g}"
    if between > PACKET * period:
        raise InputError(
            f"{path}: its rows come in packets, {1e3 * np.median(steps[steps < period]):.4g} ms apart with "
            f"{1e3 * between:.4g} ms between, so their times are not those of the measurements: {cure}"
        )
    if not 1.0 / MAX_RATE_HZ <= period <= 1.0 / slowest:
        counts = period / UNITS["time"].get(options.units.get("time", "s"), 1.0)
        fits = [unit for unit, size in UNITS["time"].items() if 1.0 <= 1.0 / (counts * size) <= MAX_BALANCED_HZ]
        raise InputError(
            f"{path}: its rows are {period:.3g} s apart, which is {1.0 / period:.3g} Hz: is the time's unit right? "
            f"Say it, --units time={fits[0] if fits else 'ms'}"
        )
    round_rate = float(f"{1.0 / period:.6g}")
    if abs(period * round_rate - 1.0) < 1e-9:
        period = 1.0 / round_rate
    dt = period if options.rate_hz is None else 1.0 / options.rate_hz
    max_gap = BRIDGED * period if options.max_gap_s is None else options.max_gap_s
    gaps = steps > gap
    divided = steps > max(gap, max_gap + period)
    stretches = [slice(start, end) for start, end in pairwise([0, *(np.flatnonzero(divided) + 1), len(time)])]
    resolution = _resolution(time)
    even = all(_is_even(time[rows], period, resolution) for rows in stretches)
    even &= not between or steps.max() <= period + resolution
    resampled = not even or abs(dt - period) > 1e-6 * dt
    shortest, longest = (1e3 * float(step) for step in (steps[~gaps].min(), max(between, steps[~gaps].max())))
    if resampled:
        rows = f"{1.0 / period:.6g} Hz" if even else f"uneven steps, {shortest:.4g} to {longest:.4g} ms, are"
        take_turns = between and np.diff(steps > gap).mean() > FEW_REPEATED
        own = f"; if they were measured evenly, {cure}" if take_turns else ""
        lines = "straight lines" if steps.min() < TIGHT * gap else "cubic splines"
        notes.append(f"{rows} resampled to {1.0 / dt:.6g} Hz by {lines}{own}")
    elif np.ptp(steps[~gaps]) > EVEN * period:
        notes.append(f"steps of {shortest:.4g} to {longest:.4g} ms taken as even sampling at {1.0 / period:.6g} Hz")
    for what, which in (
        ("bridged by straight lines", gaps & ~divided),
        ("not bridged: observers start anew after each", divided),
    ):
        if which.any():
            at = int(np.argmax(np.where(which, steps, 0.0)))
            notes.append(
                f"{counted(which.sum(), 'gap')} {what}; the longest is {steps[at] * 1e3:.4g} ms at {time[at]:.6g} s"
            )
    lengths = [(time[rows][-1] - time[rows][0]) / dt for rows in stretches]
    if sum(lengths) > MAX_SAMPLES:
        raise InputError(f"{path}: {sum(lengths):,.0f} samples at {1.0 / dt:g} Hz; at most {MAX_SAMPLES:,}")
    segments = [
        _segment(time[rows], select(values, rows), gap, dt, resampled)
        for rows, length in zip(stretches, lengths, strict=True)
        if length >= MIN_SAMPLES - 1.5
    ]
    if not segments:
        raise InputError(
            f"{path}: no part of {MIN_SAMPLES} samples at {1.0 / dt:g} Hz without a gap longer than {max_gap:.3g} s"
        )
    if len(segments) < len(stretches):
        notes.append(f"{len(stretches) - len(segments)} parts with fewer than {MIN_SAMPLES} samples discarded")
    return period, dt, segments


def _pace(steps: np.ndarray, changes: np.ndarray) -> tuple[float, float]:
    """Return the period of rows, and the usual step between packets of them, or 0 [s].

    Rows have the period of most steps if longer ones are few: at most one a second, or a few rows lost and none much
    closer; or if the longer ones are pauses, across which the signal changes by more. Otherwise long and short steps
    take turns, and the period is their mean, from the first packet to the last.
    """
    period = float(steps[steps <= GAP_PERIODS * np.median(steps)].mean())
    longer = steps > GAP_PERIODS * period
    if longer.sum() > max(4.0, steps[~longer].sum()):
        between = float(np.median(steps[longer]))
        first, *_, last = np.flatnonzero(longer) + 1
        whole = steps[first:last]
        mean = float(whole[whole < PAUSE * between].mean())
        sizes = np.abs(changes) + np.abs(np.gradient(changes))
        pauses = between > PACKET * mean and sizes[longer].mean() > ALIKE * sizes[~longer].mean()
        uneven = np.quantile(steps, 0.1) < 0.75 * period
        if not pauses and (uneven or mean > LOST * period):
            return mean, between
    return period, 0.0


def _complete(path: Path, time: np.ndarray, values: Values, notes: list[str]) -> tuple[np.ndarray, Values]:
    """Return the rows that have all numbers and a time after that of the row before."""
    present = np.isfinite(time) & np.logical_and.reduce([np.isfinite(column) for column in values.values()])
    missing = np.flatnonzero(~present)
    if len(missing):
        notes.append(
            f"{counted(len(missing), 'row')} of {len(present):,} without a usable number discarded, first row "
            f"{missing[0] + 1}"
        )
        time, values = time[present], select(values, present)
    if len(time) < MIN_SAMPLES:
        cure = ". Where each sensor has rows of its own, join them, as with pandas' groupby(TIME).first().interpolate()"
        raise InputError(
            f"{path}: {counted(len(time), 'row')} with all that is needed; at least {MIN_SAMPLES}"
            f"{cure if len(missing) else ''}"
        )
    steps = np.diff(time)
    back = steps < 0.0
    if back.any():
        at = np.argmax(back)
        cure = (
            "sort the rows by time"
            if back.mean() > FEW_REPEATED
            else "cut the log there, or leave time out and give --rate"
        )
        raise InputError(f"{path}: time goes back from {time[at]:.9g} s to {time[at + 1]:.9g} s: {cure}")
    again = steps <= SAME_TIME * np.median(steps)
    differ = np.logical_or.reduce([np.diff(column) != 0.0 for column in values.values()])
    if (again & differ).mean() > FEW_REPEATED:
        rate = "HZ" if again.all() else f"{np.argmax(time == time[-1]) / (time[-1] - time[0]):.4g}"
        raise InputError(
            f"{path}: {again.sum():,} of {len(time):,} rows have the same time as the row before: the stamps are too "
            f"coarse; leave time out and give --rate {rate}"
        )
    if again.any():
        rows, first = counted(again.sum(), "row"), time[1:][again][0]
        notes.append(f"{rows} with the time of the row before discarded, first at {first:.6g} s")
        later = np.concatenate([[True], ~again])
        time, values = time[later], select(values, later)
    return time, values


def _segment(time: np.ndarray, values: Values, gap: float, dt: float, resampled: bool) -> Segment:
    """Sample rows without a gap every dt."""
    stamps, placed, interpolate = time - time[0], time, partial(_resample, gap=gap)
    places = np.arange(int(stamps[-1] / dt + 1e-6) + 1)
    if not resampled:
        # Rows stay where they are, and those that are missing come between them.
        places = np.arange(len(time))
        if len(time) != round(stamps[-1] / dt) + 1:
            places = np.maximum.accumulate(np.rint(stamps / dt).astype(int))
            later = np.concatenate([[True], np.diff(places) > 0])
            time, places, values = time[later], places[later], select(values, later)
        stamps, interpolate = places * dt, np.interp
        placed = time[0] + stamps
    grid = dt * np.arange(places[-1] + 1)
    sampled = {name: (_held if name == HELD else interpolate)(grid, stamps, column) for name, column in values.items()}
    return Segment(time[0] + grid, sampled, time, placed, values)


def _resample(grid: np.ndarray, time: np.ndarray, values: np.ndarray, gap: float) -> np.ndarray:
    """Interpolate by a cubic spline, and by straight lines between times further apart than a gap [s].

    If some times are close together (`TIGHT`), all lines are straight.
    """
    from scipy.interpolate import CubicSpline

    if np.diff(time).min() < TIGHT * gap:
        return np.interp(grid, time, values)
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    in_gap = time[after] - time[after - 1] > gap
    return np.where(in_gap, np.interp(grid, time, values), CubicSpline(time, values)(grid))


def _held(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    return values[np.clip(np.searchsorted(time, grid + 1e-9, side="right") - 1, 0, len(values) - 1)]


def _resolution(time: np.ndarray) -> float:
    """Return the largest of 1, 0.1, 0.01 ... s that divides all stamps from the first on [s]; 0 if none does."""
    for power in range(0, 8):
        counts = (time - time[0]) * 10.0**power
        if np.abs(counts - np.rint(counts)).max() < 1e-3:
            return 10.0**-power
    return 0.0


def _is_even(time: np.ndarray, period: float, resolution: float) -> bool:
    """Return whether the rows are on an even grid, as far as stamps of this resolution show."""
    steps = np.diff(time)
    if len(time) < 3 or np.ptp(steps) < EVEN * period:
        return True
    slack = max(EVEN * period, 0.75 * resolution if resolution < period else 0.0)
    order = np.arange(len(time)) if steps.max() < GAP_PERIODS * period else np.rint((time - time[0]) / period)
    fit = np.polynomial.polynomial.polyfit(order, time - time[0], 1)
    off = time - time[0] - (fit[0] + fit[1] * order)
    return bool(np.abs(off).max() <= slack and abs(fit[1] / period - 1.0) < SAME_PERIOD)


def select(values: Values, rows: slice | np.ndarray) -> dict[str, np.ndarray]:
    """Return these rows of all columns."""
    return {name: column[rows] for name, column in values.items()}


def reference_at(segments: Sequence[Segment], time: np.ndarray, reference: np.ndarray, delay_s: float) -> np.ndarray:
    """Interpolate the reference at the samples' times; NaN before it, after it and in its gaps."""
    known = np.isfinite(time) & np.isfinite(reference)
    order = np.argsort(time[known], kind="stable")
    time, reference = time[known][order], reference[known][order]
    step = float(segments[0].time[1] - segments[0].time[0])
    later = np.diff(time, prepend=-math.inf) > SAME_TIME * step
    time, reference = time[later], reference[later]
    if len(time) < MIN_SAMPLES:
        return np.full(sum(len(segment.time) for segment in segments), np.nan)
    sampled = []
    for segment in segments:
        grid, stamps = segment.time, segment.when(time) - delay_s
        period, between = _pace(np.diff(stamps), np.diff(reference))
        gap = (2.0 if between else GAP_PERIODS) * period
        slack = 1e-6 * gap
        after = np.clip(np.searchsorted(stamps, grid, side="right"), 1, len(stamps) - 1)
        before, later = grid - stamps[after - 1], stamps[after] - grid
        known = (before >= 0.0) & (later >= 0.0) & (before + later <= gap)
        known |= np.minimum(np.abs(before), np.abs(later)) <= slack
        values = _resample(np.clip(grid, stamps[0], stamps[-1]), stamps, reference, gap)
        sampled.append(np.where(known, values, np.nan))
    return np.concatenate(sampled)
