"""Reading of a log: a file's columns are converted, checked, sampled evenly and joined."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.tilt import RadialTilt
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.replay.log import (
    ACCELEROMETERS,
    EVEN,
    ONE_ACCELEROMETER,
    REFERENCE,
    ROLES,
    UNITS,
    Column,
    Log,
    Part,
    ReadOptions,
    Values,
    columns_of,
    log_of_run,
    read_table,
)
from cmg_mj.features.replay.noise import white_noise_of
from cmg_mj.stages.push import Window, inside

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


UNWRAP_STEP = 1.5 * math.pi
"""A larger step of the tilt from one row to the next is a wrapped angle, not a motion [rad]."""
LONGEST_DELAY_S = 1e6
"""Longest delay of a reference [s]."""
FARTHEST_M = 10.0
"""Largest distance of an accelerometer from the pivot; millimetres taken as metres are larger [m]."""
NEAR = (0.7, 1.4)
"""A size is plausible if it is within these factors of the right one."""


def read_log(path: Path | str, options: ReadOptions | None = None) -> Log:
    """Read a log.

    Args:
        path: A CSV with a heading, a Parquet file, or a run's folder or its `trajectory.parquet`.
        options: The columns of the file, and how to convert and sample them; none for a run's own recording.

    Returns:
        The log.

    Raises:
        InputError: Something is wrong with the file or the options.
    """
    path, options = Path(path), options or ReadOptions()
    if path.is_dir() and (path / "trajectory.parquet").is_file():
        path = path / "trajectory.parquet"
    if not path.is_file():
        raise InputError(f"{path}: no such file; name a CSV or Parquet file, or the folder of a run")
    if not options.columns:
        return _read_run(path, options)
    columns = columns_of(options)
    geometry = accelerometer_geometry(columns, options.radii_m)
    if not abs(options.delay_s) <= LONGEST_DELAY_S:
        raise InputError(f"--delay {options.delay_s:g}: must be from -{LONGEST_DELAY_S:g} to {LONGEST_DELAY_S:g} s")
    if "rate" not in columns and (options.delay_s or options.windows_s):
        raise InputError("--delay, --window: there is no reference; name it, --columns rate=...")
    signals, dated = read_table(path, columns, options)
    time = signals.pop("time", None)
    if options.time_range_s is not None:
        time, signals = _cut(path, time, signals, options)
    notes: list[str] = []
    unit_known = time is None or dated or columns["time"].unit_known
    if not unit_known:
        notes.append(f"the time {columns['time'].name!r} is taken as seconds")
    measured = _measured(signals, geometry, notes)
    sampler = Sampler(str(path), options.rate_hz, options.max_gap_s, notes, ("u_rad_s",), unit_known)
    dt, parts = sampler.parts(time, measured)
    joined = _join(parts)
    if "rate" in signals:
        joined[REFERENCE] = _reference(parts, time, signals["rate"], options)
    _check_motion(path, joined, "rate" in signals)
    ends = np.cumsum([len(part.time) for part in parts]).tolist()
    slices = [slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
    notes += gravity_remarks(columns, signals)
    if "ax" in signals:
        notes.append("the tilt is atan2(-ax, az): an acceleration of the sensor by 0.1 g puts it off by 5.7 deg")
    present = {
        "gimbals": {"y2_rad", "u_rad_s"} <= measured.keys(),
        "acceleration": "acceleration_rad_s2" in measured,
        "reference": "rate" in signals,
    }
    has = frozenset(name for name, known in present.items() if known)
    windows = _windows_inside(path, options.windows_s, joined["time_s"])
    options = replace(options, units={role: column.unit for role, column in columns.items()})
    period = sampler.period or dt
    noise = white_noise_of(parts, period)
    return Log(path.stem, dt, joined, slices, has, geometry, windows, tuple(notes), options, None, period, noise)


def _read_run(path: Path, options: ReadOptions) -> Log:
    log = log_of_run(path)
    given = [field for field in options.as_toml() if field != "windows_s"]
    if given:
        raise InputError(f"{path}: {given[0]} is for other logs than a run's own recording; read it with --columns")
    if not options.windows_s:
        return log
    return replace(log, windows=_windows_inside(path, options.windows_s, log["time_s"]))


def check_distinct_logs(paths: Sequence[str]) -> None:
    """Refuse a log that is named twice: it would count twice in means and intervals."""
    known: set[str] = set()
    for name in paths:
        path = os.path.realpath(name).removesuffix("/trajectory.parquet")
        if path in known:
            raise InputError(f"{name}: this log is given twice")
        known.add(path)


def accelerometer_geometry(columns: Mapping[str, Column], radii: tuple[float, float] | None) -> RadialTilt | None:
    """Return the geometry of two accelerometers; None if there are none."""
    if ("inner_x" in columns) != (radii is not None):
        raise InputError("--radii INNER,OUTER [m] and --columns inner_x, inner_z, outer_x, outer_z go together")
    if radii is None:
        return None
    inner, outer = radii
    if not 0.0 <= inner < outer <= FARTHEST_M:
        raise InputError(
            f"--radii {inner:g},{outer:g}: must be two distances from the pivot, the smaller first, at most "
            f"{FARTHEST_M:g} m"
        )
    return RadialTilt(inner, outer)


def _windows_inside(path: Path, windows: Sequence[Window], time: np.ndarray) -> tuple[Window, ...]:
    """Check that each window holds a sample, and return the windows."""
    for start, end in windows:
        if not inside(time, [(start, end)]).any():
            ends = f"{time[0]:.6g} to {time[-1]:.6g} s"
            raise InputError(f"--window {start:g}:{end:g}: {path} has no sample there; it goes from {ends}")
    return tuple(windows)


def _check_motion(path: Path, columns: Mapping[str, np.ndarray], referred: bool) -> None:
    """Refuse a log without motion."""
    tilt, reference = columns["y1_rad"], columns[REFERENCE]
    known = reference[np.isfinite(reference)]
    if np.ptp(tilt) == 0.0:
        raise InputError(f"{path}: the tilt is {tilt[0]:g} rad in every row: nothing moves")
    if referred and not len(known):
        raise InputError(f"{path}: the reference has no number where the tilt has one")
    if referred and np.ptp(known) == 0.0:
        raise InputError(f"{path}: the reference is {known[0]:g} rad/s in every row: leave it out")


def _cut(
    path: Path, time: np.ndarray | None, signals: Mapping[str, np.ndarray], options: ReadOptions
) -> tuple[np.ndarray | None, dict[str, np.ndarray]]:
    """Return the rows between two times, counted from the earliest."""
    assert options.time_range_s is not None
    start, end = options.time_range_s
    if time is None:
        clock = np.arange(len(next(iter(signals.values())))) / (options.rate_hz or 1.0)
    else:
        clock = time - np.nanmin(time)
    rows = (clock >= start - 1e-9) & (clock <= end + 1e-9)
    if not rows.any():
        raise InputError(f"--time-range {start:g}:{end:g}: {path} has no row there; it lasts {np.nanmax(clock):.6g} s")
    return None if time is None else time[rows], {role: values[rows] for role, values in signals.items()}


def _measured(
    signals: Mapping[str, np.ndarray], geometry: RadialTilt | None, notes: list[str]
) -> dict[str, np.ndarray]:
    """Return row by row the observers' measurements, by their names in a trajectory."""
    measured = {}
    if geometry is not None:
        angle = geometry(*(signals[role] for role in ACCELEROMETERS))
        measured["acceleration_rad_s2"] = geometry.acceleration(signals["inner_x"], signals["outer_x"])
    else:
        angle = tilt_of_one(signals["ax"], signals["az"]) if "ax" in signals else signals["tilt"]
        if "acceleration" in signals:
            measured["acceleration_rad_s2"] = signals["acceleration"]
    measured = {"y1_rad": unwrapped(np.asarray(angle), notes), **measured}
    if "gimbal" in signals:
        measured["y2_rad"] = signals["gimbal"]
    elif "gimbal1" in signals:
        measured["y2_rad"] = (signals["gimbal1"] - signals["gimbal2"]) / 2.0
    if "command" in signals:
        measured["u_rad_s"] = signals["command"]
    if ("y2_rad" in measured) != ("u_rad_s" in measured):
        notes.append("observers that need the gimbals need both gimbal and command; there is one of them")
    return measured


def _join(parts: Sequence[Part]) -> dict[str, np.ndarray]:
    """Join all parts, with every column of a log."""
    time = np.concatenate([part.time for part in parts])
    columns = {"time_s": time - time[0] if abs(time[0]) > 1e6 else time}
    absent = {"y1_rad": 0.0, "y2_rad": 0.0, "u_rad_s": 0.0, "acceleration_rad_s2": math.nan, REFERENCE: math.nan}
    for name, value in absent.items():
        columns[name] = np.concatenate([part.values.get(name, np.full(len(part.time), value)) for part in parts])
    return columns


def _reference(
    parts: Sequence[Part], time: np.ndarray | None, reference: np.ndarray, options: ReadOptions
) -> np.ndarray:
    """Sample the reference where the parts are."""
    stamps = np.arange(len(reference)) / (options.rate_hz or 1.0) if time is None else time
    known = np.isfinite(stamps)
    stamps, reference = stamps[known], reference[known]
    order = np.argsort(stamps, kind="stable")
    stamps, reference = stamps[order], reference[order]
    step = float(parts[0].time[1] - parts[0].time[0])
    first = np.concatenate([[True], np.diff(stamps) > SAME_TIME * step])
    stamps, reference = stamps[first], reference[first]
    delayed = (sampled_where_known(part.time, part.when(stamps) - options.delay_s, reference) for part in parts)
    return np.concatenate(list(delayed))


def unwrapped(angle: np.ndarray, notes: list[str]) -> np.ndarray:
    """Unwrap an angle that starts again after a turn, and note it."""
    known = np.isfinite(angle)
    jumps = int((np.abs(np.diff(angle[known])) > UNWRAP_STEP).sum())
    if not jumps:
        return angle
    notes.append(f"the tilt jumps by a turn {jumps:,} time{'' if jumps == 1 else 's'}: made to run on")
    out = angle.copy()
    out[known] = np.unwrap(angle[known])
    return out


def tilt_of_one(ax: np.ndarray, az: np.ndarray) -> np.ndarray:
    """Return the tilt that one accelerometer at rest shows.

    Args:
        ax: Specific force along the motion of a growing tilt, -g sin(tilt) at rest, (n,) [m/s^2].
        az: Specific force outward along the tilting line, g cos(tilt) at rest, (n,) [m/s^2].

    Returns:
        (n,) [rad].
    """
    return np.arctan2(-ax, az)


def gravity_remarks(columns: Mapping[str, Column], signals: Mapping[str, np.ndarray]) -> list[str]:
    """Compare the size and the sign of each accelerometer's specific force with gravity's, by their medians.

    Args:
        columns: Role -> column.
        signals: Role -> values in SI units, (n_rows,).

    Returns:
        A line for each that is wrong, with the options that cure it.
    """
    remarks = []
    for x, z in (ACCELEROMETERS[:2], ACCELEROMETERS[2:], ONE_ACCELEROMETER):
        if x not in signals:
            continue
        size = float(np.nanmedian(np.hypot(signals[x], signals[z]))) / STANDARD_GRAVITY
        upward = float(np.nanmedian(signals[z]))
        if size > 0.0 and not NEAR[0] <= size <= NEAR[1]:
            unit = _unit_of_size(columns[z].unit, size)
            cures = (f"{role}={columns[role].scale / size:.4g}" for role in (x, z))
            cure = f"--units {x}={unit},{z}={unit}" if unit else f"--scale {','.join(cures)}"
            remarks.append(f"the specific force of {x} and {z} is {size:.4g} times gravity's 9.81 m/s^2: {cure}")
        elif upward < 0.0:
            turned = ",".join(f"{role}={-columns[role].scale:g}" for role in (x, z))
            remarks.append(
                f"the median of {z} is {upward / STANDARD_GRAVITY:.2g} g, so the tilt is beyond 90 deg: --scale "
                f"{turned} if the sensor shows gravity itself, --scale {z}={-columns[z].scale:g} if it is upside down"
            )
    return remarks


def _unit_of_size(unit: str, size: float) -> str | None:
    """Return the unit in which a specific force is gravity's, if it is that many times gravity in another."""
    units = UNITS[ROLES["ax"]]
    fits = {other: abs(math.log(units[unit] / other_size / size)) for other, other_size in units.items()}
    best = min(fits, key=lambda other: fits[other])
    return best if fits[best] < math.log(NEAR[1]) else None
