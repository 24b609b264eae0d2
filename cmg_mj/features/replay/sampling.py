"""Rows at any times -> evenly sampled parts, with a note on every change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cmg_mj.core.errors import InputError

EVEN = 0.02
"""Deviation from an even grid, in periods, up to which stamps count as even."""
SAME_PERIOD = 1e-3
"""Relative difference up to which the line through the rows has their period."""
GAP_PERIODS = 1.5
"""A gap is longer than so many periods."""
FEWEST = 20
"""A part with fewer rows is discarded."""
BRIDGED = 5
"""Longest gap that is bridged by default, in rows."""
FEW_REPEATED = 0.05
"""Share of rows with the stamp of the row before, up to which these rows are discarded; more are a mistake."""
SAME_TIME = 1e-6
"""Distance of two rows, in usual steps, up to which they have the same time."""
SLOWEST_HZ, FASTEST_HZ = 0.1, 1e6
BALANCED_HZ = 5.0
"""Rate below which nothing balances: milliseconds taken as seconds have at most this, up to 5 kHz [Hz]."""
MOST_ROWS = 5_000_000
"""Most samples of a log; more take hours."""

Values = Mapping[str, np.ndarray]
"""Name -> (n_rows,)."""


@dataclass(frozen=True)
class Part:
    """Rows without a gap, evenly sampled.

    Attributes:
        time: (n,) [s].
        values: Name -> (n,).
        stamps: The rows' own times, (m,) [s].
        placed: The rows' times in `time`, which differ from rounded stamps, (m,) [s].
        rows: Name -> the rows' own values, (m,).
    """

    time: np.ndarray
    values: Values
    stamps: np.ndarray
    placed: np.ndarray
    rows: Values

    def when(self, stamps: np.ndarray) -> np.ndarray:
        """Convert other rows' stamps to times in this part, beyond its ends too, (k,) [s]."""
        before, after = self.stamps[0] - self.placed[0], self.stamps[-1] - self.placed[-1]
        inside = np.interp(stamps, self.stamps, self.placed)
        return np.where(
            stamps < self.stamps[0], stamps - before, np.where(stamps > self.stamps[-1], stamps - after, inside)
        )


@dataclass
class Sampler:
    """Divides rows into parts and samples them evenly.

    Attributes:
        where: The file, for messages.
        rate_hz: Rate of rows without times; else the rate to resample to, or None for the rows' own.
        max_gap_s: Longer gaps part the log; None for `BRIDGED` periods.
        notes: Changes to the rows.
        held: Names of signals that hold until the next row, such as a command.
        unit_known: Whether the unit of the times is known; else milliseconds taken as seconds are refused.
        period: Period of the file's own rows, once they are read [s].
    """

    where: str
    rate_hz: float | None
    max_gap_s: float | None
    notes: list[str]
    held: Sequence[str] = ()
    unit_known: bool = True
    period: float | None = None

    def parts(self, time: np.ndarray | None, measured: Values) -> tuple[float, list[Part]]:
        """Discard incomplete rows, and resample the others if they are uneven.

        Args:
            time: Stamps, (n_rows,) [s]; None for rows that are even.
            measured: Name -> values, (n_rows,); a row must have all of them.

        Returns:
            The sample period [s], and the parts.

        Raises:
            InputError: Times run backward or stand still, too few rows are complete, or the rate is impossible.
        """
        if time is None:
            if self.rate_hz is None:
                raise InputError(f"{self.where}: no time: name its column, --columns time=..., or give --rate HZ")
            time = np.arange(len(measured["y1_rad"])) / self.rate_hz
        present = np.isfinite(time) & np.logical_and.reduce([np.isfinite(values) for values in measured.values()])
        missing = np.flatnonzero(~present)
        if len(missing):
            self.notes.append(
                f"{_rows(len(missing))} of {len(present):,} without a number discarded, first row {missing[0] + 1}"
            )
            time, measured = time[present], _select(measured, present)
        time, measured = self._forward(time, measured)
        if len(time) < FEWEST:
            raise InputError(f"{self.where}: {_rows(len(time))} with all that is needed; at least {FEWEST}")
        return self._on_a_grid(time, measured)

    def _forward(self, time: np.ndarray, values: Values) -> tuple[np.ndarray, Values]:
        """Return the rows with growing times."""
        steps = np.diff(time)
        if (steps < 0.0).any():
            at = int(np.argmax(steps < 0.0))
            raise InputError(
                f"{self.where}: time goes back from {time[at]:.9g} s to {time[at + 1]:.9g} s: cut the log there, or "
                "leave time out and give --rate"
            )
        again = steps <= SAME_TIME * np.median(steps) if len(steps) else steps > 0.0
        if len(again) and again.mean() > FEW_REPEATED:
            raise InputError(
                f"{self.where}: {again.sum():,} of {len(time):,} rows have the same time as the row before: the stamps "
                "are too coarse; leave time out and give --rate"
            )
        if again.any():
            first = time[1:][again][0]
            self.notes.append(f"{_rows(again.sum())} with the time of the row before discarded, first at {first:.6g} s")
            mask = np.concatenate([[True], ~again])
            time, values = time[mask], _select(values, mask)
        return time, values

    def _on_a_grid(self, time: np.ndarray, values: Values) -> tuple[float, list[Part]]:
        steps = np.diff(time)
        period = float(steps[steps <= GAP_PERIODS * float(np.median(steps))].mean())
        slowest = SLOWEST_HZ if self.unit_known else BALANCED_HZ
        if not 1.0 / FASTEST_HZ <= period <= 1.0 / slowest:
            raise InputError(
                f"{self.where}: its rows are {period:.3g} s apart, which is {1.0 / period:.3g} Hz: is the time's unit "
                "right? Say it, --units time=ms or time=s"
            )
        self.period = period = rounded_period(period)
        longest = BRIDGED * period if self.max_gap_s is None else self.max_gap_s
        gaps = steps > GAP_PERIODS * period
        parted = steps > max(GAP_PERIODS * period, longest + period)
        stretches = [slice(a, b) for a, b in pairwise([0, *(np.flatnonzero(parted) + 1), len(time)])]
        resolution = resolution_of(time)
        even = all(is_even(time[s], period, resolution) for s in stretches)
        dt = period if self.rate_hz is None else 1.0 / self.rate_hz
        resampled = not even or abs(dt - period) > 1e-6 * dt
        if resampled:
            rows = f"{1.0 / period:.6g} Hz" if even else f"uneven steps, {_span(steps[~gaps])}, are"
            self.notes.append(f"{rows} resampled to {1.0 / dt:.6g} Hz by cubic splines")
        elif np.ptp(steps[~gaps]) > EVEN * period:
            self.notes.append(f"steps of {_span(steps[~gaps])} taken as even sampling at {1.0 / period:.6g} Hz")
        for what, which in (
            ("bridged by straight lines", gaps & ~parted),
            ("not bridged: observers start anew after each", parted),
        ):
            if which.any():
                at = int(np.argmax(np.where(which, steps, 0.0)))
                self.notes.append(
                    f"{which.sum():,} gap{'' if which.sum() == 1 else 's'} {what}; the longest is "
                    f"{steps[at] * 1e3:.4g} ms at {time[at]:.6g} s"
                )
        total = sum((time[s][-1] - time[s][0]) / dt for s in stretches)
        if total > MOST_ROWS:
            raise InputError(f"{self.where}: {total:,.0f} samples at {1.0 / dt:g} Hz; at most {MOST_ROWS:,}")
        parts = [
            self._part(time[s], _select(values, s), period, dt, resampled)
            for s in stretches
            if (time[s][-1] - time[s][0]) / dt >= FEWEST - 1.5
        ]
        if not parts:
            raise InputError(
                f"{self.where}: no part of {FEWEST} samples at {1.0 / dt:g} Hz without a gap longer than "
                f"{longest:.3g} s"
            )
        if len(parts) < len(stretches):
            self.notes.append(f"{len(stretches) - len(parts)} parts with fewer than {FEWEST} samples discarded")
        return dt, parts

    def _part(self, time: np.ndarray, values: Values, period: float, dt: float, resampled: bool) -> Part:
        if resampled:
            grid = dt * np.arange(int((time[-1] - time[0]) / dt + 1e-6) + 1)
            stamps, gap = time - time[0], GAP_PERIODS * period
            sampled = {name: resample(grid, stamps, column, gap, name in self.held) for name, column in values.items()}
            return Part(time[0] + grid, sampled, time, time, values)
        if len(time) == round((time[-1] - time[0]) / dt) + 1:
            grid = time[0] + dt * np.arange(len(time))
            return Part(grid, values, time, grid, values)
        # Rows stay where they are, and those that are missing come between them.
        places = np.maximum.accumulate(np.rint((time - time[0]) / dt).astype(int))
        mask = np.concatenate([[True], np.diff(places) > 0])
        time, places, values = time[mask], places[mask], _select(values, mask)
        stamps, grid = places * dt, dt * np.arange(places[-1] + 1)
        filled = {
            name: _held(grid, stamps, column) if name in self.held else np.interp(grid, stamps, column)
            for name, column in values.items()
        }
        return Part(time[0] + grid, filled, time, time[0] + stamps, values)


def resample(grid: np.ndarray, time: np.ndarray, values: np.ndarray, gap: float, held: bool = False) -> np.ndarray:
    """Interpolate by a cubic spline, in gaps by straight lines; held values by the last one before.

    Args:
        grid: Wanted times, (n,), within those there are [s].
        time: Times there are, growing, (m,) [s].
        values: (m,).
        gap: More between two of them is a gap [s].
        held: Whether a value holds until the next.

    Returns:
        (n,).
    """
    from scipy.interpolate import CubicSpline

    if held:
        return _held(grid, time, values)
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    in_gap = time[after] - time[after - 1] > gap
    return np.where(in_gap, np.interp(grid, time, values), CubicSpline(time, values)(grid))


def _held(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    return values[np.clip(np.searchsorted(time, grid + 1e-9, side="right") - 1, 0, len(values) - 1)]


def sampled_where_known(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Interpolate a reference at the samples' times; NaN before it, after it and in its gaps.

    Args:
        grid: The samples' times, (n,) [s].
        time: Its own times, growing, (m,) [s].
        values: (m,), NaN where it is missing.

    Returns:
        (n,).
    """
    known = np.isfinite(values)
    time, values = time[known], values[known]
    if len(time) < FEWEST:
        return np.full(len(grid), np.nan)
    gap = GAP_PERIODS * float(np.median(np.diff(time)))
    slack = 1e-6 * gap
    inside = (grid >= time[0] - slack) & (grid <= time[-1] + slack)
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    near = np.minimum(np.abs(grid - time[after - 1]), np.abs(time[after] - grid)) <= slack
    sampled = resample(np.clip(grid, time[0], time[-1]), time, values, gap)
    return np.where(inside & ((time[after] - time[after - 1] <= gap) | near), sampled, np.nan)


def rounded_period(period: float) -> float:
    """Return the period of a round rate, if the period is one to the stamps' accuracy."""
    rate = float(f"{1.0 / period:.6g}")
    return 1.0 / rate if abs(period * rate - 1.0) < 1e-9 else period


def resolution_of(time: np.ndarray) -> float:
    """Return the largest of 1, 0.1, 0.01 ... s that divides all stamps from the first on [s]; 0 if none does."""
    for power in range(0, 8):
        counts = (time - time[0]) * 10.0**power
        if np.abs(counts - np.rint(counts)).max() < 1e-3:
            return 10.0**-power
    return 0.0


def is_even(time: np.ndarray, period: float, resolution: float) -> bool:
    """Return whether the rows are on an even grid, as far as stamps of this resolution show."""
    steps = np.diff(time)
    if len(time) < 3 or np.ptp(steps) < EVEN * period:
        return True
    slack = max(EVEN * period, 0.75 * resolution if resolution < period else 0.0)
    order = np.arange(len(time)) if steps.max() < GAP_PERIODS * period else np.rint((time - time[0]) / period)
    fit = np.polynomial.polynomial.polyfit(order, time - time[0], 1)
    off = time - time[0] - (fit[0] + fit[1] * order)
    return bool(np.abs(off).max() <= slack and abs(fit[1] / period - 1.0) < SAME_PERIOD)


def _select(values: Values, rows: slice | np.ndarray) -> Values:
    return {name: column[rows] for name, column in values.items()}


def _span(steps: np.ndarray) -> str:
    return f"{steps.min() * 1e3:.4g} to {steps.max() * 1e3:.4g} ms"


def _rows(count: int) -> str:
    return f"{count:,} row{'' if count == 1 else 's'}"
