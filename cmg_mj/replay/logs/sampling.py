"""Rows at any times -> evenly sampled parts, with a note on every change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.replay.logs.resampling import (
    EVEN,
    FEWEST,
    GAP_PERIODS,
    bridge,
    is_even,
    resample,
    resolution_of,
    rounded_period,
)
from cmg_mj.replay.logs.table import MOST_ROWS
from cmg_mj.results.stored_columns import StoredColumns, masked, number_of_rows, reversed_rows, shelved

BRIDGED = 5
"""Longest gap that is bridged by default, in rows."""
FEW_REPEATED = 0.05
"""Share of rows with the stamp of the row before, up to which these rows are discarded; more are a mistake."""
SAME_TIME = 1e-6
"""Distance of two rows, in usual steps, up to which they have the same time."""
SLOWEST_HZ, FASTEST_HZ = 0.1, 1e6


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
    values: Mapping[str, np.ndarray]
    stamps: np.ndarray
    placed: np.ndarray
    rows: StoredColumns

    @property
    def step(self) -> float:
        """Sample period [s]."""
        return float(self.time[1] - self.time[0])

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
        period: Period of the file's own rows, once they are read [s].
    """

    where: str
    rate_hz: float | None
    max_gap_s: float | None
    notes: list[str]
    held: Sequence[str] = ()
    period: float | None = None

    def parts(self, time: np.ndarray | None, measured: Mapping[str, np.ndarray]) -> tuple[float, list[Part]]:
        """Discard incomplete rows, and resample the others if they are uneven.

        Args:
            time: Stamps, (n_rows,) [s]; None for rows that are even.
            measured: Name -> values, (n_rows,); a row must have all of them.

        Returns:
            The sample period [s], and the parts.

        Raises:
            InputError: Times run backward or stand still, too few rows are complete, or the rate is impossible.
        """
        n = number_of_rows(measured)
        if time is None:
            if self.rate_hz is None:
                raise InputError(f"{self.where}: no time: name its column, --columns time=..., or give --rate HZ")
            time = np.arange(n) / self.rate_hz
        present = np.isfinite(time) & np.logical_and.reduce([np.isfinite(values) for values in measured.values()])
        if not present.any():
            raise InputError(f"{self.where}: no row has a number in each of its columns")
        if not present.all():
            self.notes.append(_missing(present, time, measured))
        time, values = self._forward(time if present.all() else time[present], masked(measured, present))
        if len(time) < FEWEST:
            raise InputError(f"{self.where}: {_rows(len(time))} with all that is needed; at least {FEWEST}")
        return self._on_a_grid(time, values)

    def _forward(self, time: np.ndarray, values: StoredColumns) -> tuple[np.ndarray, StoredColumns]:
        """Return the rows with growing times."""
        steps = np.diff(time)
        if len(steps) and (steps <= 0.0).all() and (steps < 0.0).any():
            self.notes.append("the time runs backward from the first row to the last: read from its end")
            time, values = time[::-1], reversed_rows(values)
            steps = np.diff(time)
        if (steps < 0.0).any():
            at = int(np.argmax(steps < 0.0))
            raise InputError(
                f"{self.where}: time goes back from {time[at]:.9g} s to {time[at + 1]:.9g} s, "
                f"{'there alone' if (steps < 0.0).sum() == 1 else f'the first of {(steps < 0.0).sum()} times'}: "
                "cut the log there, or leave time out and give --rate"
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
            time, values = time[mask], masked(values, mask)
        return time, values

    def _on_a_grid(self, time: np.ndarray, values: StoredColumns) -> tuple[float, list[Part]]:
        steps = np.diff(time)
        usual = float(np.median(steps))
        period = float(steps[steps <= GAP_PERIODS * usual].mean())
        if not 1.0 / FASTEST_HZ <= period <= 1.0 / SLOWEST_HZ:
            raise InputError(
                f"{self.where}: its rows are {period:.3g} s apart, which is {1.0 / period:.3g} Hz; a log has "
                f"{SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz: is the time's unit right? (--units time=ms)"
            )
        self.period = period = rounded_period(period)
        longest = BRIDGED * period if self.max_gap_s is None else self.max_gap_s
        ends = np.flatnonzero(steps > max(GAP_PERIODS * period, longest + period))
        bounds = [0, *(ends + 1), len(time)]
        stretches = [slice(a, b) for a, b in pairwise(bounds)]
        resolution = resolution_of(time)
        even = all(is_even(time[s], period, resolution) for s in stretches)
        dt = period if self.rate_hz is None else 1.0 / self.rate_hz
        resampled = not even or abs(dt - period) > 1e-6 * dt
        self._say_how(steps[steps <= GAP_PERIODS * period], period, dt, even, resampled, resolution)
        bridged = (steps > GAP_PERIODS * period) & (steps <= max(GAP_PERIODS * period, longest + period))
        if bridged.any():
            self.notes.append(_gaps("bridged by straight lines", time, steps, bridged))
        if len(ends):
            parted = np.zeros(len(steps), dtype=bool)
            parted[ends] = True
            self.notes.append(_gaps("not bridged: observers start anew after each", time, steps, parted))
        total = sum((time[s][-1] - time[s][0]) / dt for s in stretches)
        if total > MOST_ROWS:
            raise InputError(f"{self.where}: {total:,.0f} samples at {1.0 / dt:g} Hz; at most {MOST_ROWS:,}")
        parts = [
            self._part(time[s], values.rows(s), period, dt, resampled)
            for s in stretches
            if (time[s][-1] - time[s][0]) / dt >= FEWEST - 1.5
        ]
        if len(parts) < len(stretches):
            self.notes.append(f"{len(stretches) - len(parts)} parts with fewer than {FEWEST} samples discarded")
        if not parts and not len(ends):
            n, rate = int((time[-1] - time[0]) / dt + 1e-6) + 1, f"{time[-1] - time[0]:.4g} s at {1.0 / dt:g} Hz"
            raise InputError(f"{self.where}: {rate} are {n} sample{'' if n == 1 else 's'}; at least {FEWEST}")
        if not parts:
            raise InputError(f"{self.where}: no part of {FEWEST} samples without a gap longer than {longest:.3g} s")
        return dt, parts

    def _say_how(
        self, steps: np.ndarray, period: float, dt: float, even: bool, resampled: bool, resolution: float
    ) -> None:
        """Note how uneven rows are, and whether they are resampled."""
        span = f"{steps.min() * 1e3:.4g} to {steps.max() * 1e3:.4g} ms"
        if resampled and even:
            self.notes.append(f"{1.0 / period:.6g} Hz resampled to {1.0 / dt:.6g} Hz by cubic splines")
        elif resampled:
            off = float(np.std(steps)) * 1e3
            self.notes.append(
                f"uneven sampling: steps of {span}, {off:.2g} ms about their mean; resampled to {1.0 / dt:.6g} Hz by "
                "cubic splines"
            )
        elif np.ptp(steps) > EVEN * period:
            self.notes.append(
                f"steps of {span}: to the stamps' {resolution * 1e3:.3g} ms that is even sampling at "
                f"{1.0 / period:.6g} Hz, and taken as such"
            )

    def _part(self, time: np.ndarray, values: StoredColumns, period: float, dt: float, resampled: bool) -> Part:
        if not resampled and len(time) == round((time[-1] - time[0]) / dt) + 1:
            grid = time[0] + dt * np.arange(len(time))
            return Part(grid, values, time, grid, values)
        if not resampled:  # rows stay where they are, and those that are missing come between them
            places = np.rint((time - time[0]) / dt).astype(int)
            places = np.maximum.accumulate(places)
            mask = np.concatenate([[True], np.diff(places) > 0])
            time, places = time[mask], places[mask]
            values = masked(values, mask)
            stamps, grid = places * dt, dt * np.arange(places[-1] + 1)
            filled = {name: shelved(bridge(grid, stamps, column, name in self.held)) for name, column in values.items()}
            return Part(time[0] + grid, StoredColumns(filled, 0, len(grid)), time, time[0] + stamps, values)
        grid = dt * np.arange(int((time[-1] - time[0]) / dt + 1e-6) + 1)
        stamps = time - time[0]
        sampled = {
            name: shelved(resample(grid, stamps, column, GAP_PERIODS * period, name in self.held))
            for name, column in values.items()
        }
        return Part(time[0] + grid, StoredColumns(sampled, 0, len(grid)), time, time, values)


def _missing(present: np.ndarray, time: np.ndarray, measured: Mapping[str, np.ndarray]) -> str:
    """Describe the incomplete rows."""
    lacks = {name: int((~np.isfinite(values)).sum()) for name, values in measured.items()}
    lacks["time"] = int((~np.isfinite(time)).sum())
    named = ", ".join(f"{name} in {count:,}" for name, count in lacks.items() if count)
    missing = np.flatnonzero(~present)
    edges = np.flatnonzero(np.diff(missing) > 1)
    runs = np.diff(np.concatenate([[0], edges + 1, [len(missing)]]))
    return (
        f"{_rows(len(missing))} of {len(present):,} without a number ({named}) discarded: the first is row "
        f"{missing[0] + 1}, the longest run {_rows(int(runs.max()))}"
    )


def _gaps(what: str, time: np.ndarray, steps: np.ndarray, which: np.ndarray) -> str:
    """Describe gaps."""
    longest = int(np.argmax(np.where(which, steps, 0.0)))
    count = int(which.sum())
    return (
        f"{count:,} gap{'' if count == 1 else 's'} {what}; the longest is {steps[longest] * 1e3:.4g} ms "
        f"at {time[longest]:.6g} s"
    )


def _rows(count: int) -> str:
    return f"{count:,} row{'' if count == 1 else 's'}"
