"""Reading of a log: a file's columns are converted, checked, sampled evenly and joined."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cmg_mj.errors import InputError
from cmg_mj.replay.logs.acceleration_checks import TiltMotion, implausible_acceleration
from cmg_mj.replay.logs.checks import (
    accelerometer_geometry,
    check_assumed,
    check_motion,
    check_numbers,
    check_sizes,
    windows_inside,
)
from cmg_mj.replay.logs.columns import ACCELEROMETERS, ONE_ACCELEROMETER, Column, columns_of
from cmg_mj.replay.logs.from_run import log_of_trajectory
from cmg_mj.replay.logs.log import REFERENCE, Log, ReadOptions
from cmg_mj.replay.logs.one_accelerometer import remarks_on_one, tilt_of_one
from cmg_mj.replay.logs.resampling import sampled_where_known
from cmg_mj.replay.logs.sampling import SAME_TIME, Part, Sampler
from cmg_mj.replay.logs.table import read_table
from cmg_mj.replay.logs.units import in_si
from cmg_mj.replay.logs.white_noise import white_noise_of
from cmg_mj.results.memory import release_free_memory
from cmg_mj.results.stored_columns import (
    LONG,
    Reader,
    StoredColumns,
    masked,
    shelved,
    stretches,
)
from cmg_mj.sensors.tilt import RadialTilt

UNWRAP_STEP = 1.5 * math.pi
"""A larger step of the tilt from one row to the next is a wrapped angle, not a motion [rad]."""
FLICKER = 0.2
"""Noise makes an angle near the end of its turn wrap and return at once, within this of a full turn [rad]."""
LONGEST_DELAY_S = 1e6
"""Longest delay of a reference [s]."""


def read_log(path: Path | str, options: ReadOptions | None = None) -> Log:
    """Read a log.

    Args:
        path: A CSV with a heading, a Parquet file, or what has known columns: a run's folder or its
            `trajectory.parquet`.
        options: The columns of the file, and how to convert and sample them; none for a run's own recording.

    Returns:
        The log.

    Raises:
        InputError: Something is wrong with the file or the options.
    """
    path, options = Path(path), options or ReadOptions()
    if path.is_dir() and (path / "trajectory.parquet").is_file():
        path = path / "trajectory.parquet"
    if not options.columns:
        return _read_run(path, options)
    rows = _convert(path, options)
    if options.time_range_s is not None:
        rows = _cut(path, rows, options.time_range_s, options.rate_hz)
    sampler = Sampler(str(path), options.rate_hz, options.max_gap_s, rows.notes, held=("u_rad_s",))
    measured = _measured(rows)
    dt, parts = sampler.parts(rows.time, measured)
    joined = _join(parts, rows, options)
    check_motion(path, joined, rows.referred)
    has = _signals_in(measured, rows)
    if options.windows_s and not rows.referred:
        raise InputError("--window: there is no reference to score against; name it, --columns rate=...")
    windows = windows_inside(path, options.windows_s, joined["time_s"])
    ends = np.cumsum([len(part.time) for part in parts]).tolist()
    slices = [slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
    notes = list(rows.notes)
    if "acceleration" in has:
        motion = TiltMotion(joined["y1_rad"], joined["acceleration_rad_s2"], slices, dt)
        notes += implausible_acceleration(rows.columns, rows.signals, motion, rows.tilt)
    if "ax" in rows.columns:
        notes += remarks_on_one(rows.columns, rows.signals, joined, slices, dt)
    units = {role: column.unit for role, column in rows.columns.items()}
    options = replace(options, units=units)
    period = sampler.period or dt
    noise = white_noise_of(parts, period)
    release_free_memory()  # of the file's cells and the resampling
    return Log(path.stem, dt, joined, slices, has, rows.tilt, windows, tuple(notes), options, None, period, noise)


def _read_run(path: Path, options: ReadOptions) -> Log:
    log = log_of_trajectory(path)
    for field in options.as_toml():
        if field != "windows_s":
            raise InputError(f"{_option(field)}: {path} is a run's own recording; read it with --columns for that")
    if not options.windows_s:
        return log
    return replace(log, windows=windows_inside(path, options.windows_s, log["time_s"]))


def _option(field: str) -> str:
    """Return the option of `cmg-mj replay` that sets a field: `max_gap_s` is --max-gap."""
    return "--" + re.sub("_(hz|s|m)$", "", field).replace("_", "-")


@dataclass(frozen=True)
class _Rows:
    """The rows of a file in SI units and radians.

    Attributes:
        columns: Role -> column.
        tilt: Geometry of the accelerometers, if they measure the tilt.
        time: Stamps, (n_rows,) [s]; None without a time column.
        signals: Role -> values, (n_rows,), without the time; those of a long log are read when they are asked for.
        notes: Changes to the rows, a line each; reading adds more.
    """

    columns: Mapping[str, Column]
    tilt: RadialTilt | None
    time: np.ndarray | None
    signals: StoredColumns
    notes: list[str]

    @property
    def referred(self) -> bool:
        """True if there is a reference."""
        return "rate" in self.signals

    @property
    def reference(self) -> np.ndarray:
        """The reference rate, (n_rows,) [rad/s]."""
        return self.signals["rate"]


def _convert(path: Path, options: ReadOptions) -> _Rows:
    """Read the columns of a file, convert them, and check them one by one."""
    columns = columns_of(options.columns, options.units, options.scale, options.offset)
    tilt = accelerometer_geometry(columns, options.radii_m)
    if not abs(options.delay_s) <= LONGEST_DELAY_S:
        raise InputError(f"--delay {options.delay_s:g}: must be from -{LONGEST_DELAY_S:g} to {LONGEST_DELAY_S:g} s")
    if options.delay_s and "rate" not in columns:
        raise InputError("--delay: there is no reference to shift; name it, --columns rate=...")
    headings = [column.name for column in columns.values()]
    table, notes, dated = read_table(path, headings, columns["time"].name if "time" in columns else None)
    if dated:  # seconds already, whatever the heading ends in
        clock = columns["time"]
        columns["time"] = replace(clock, unit="s", factor=clock.factor / in_si("time", clock.unit), unit_known=True)
    signals = StoredColumns({role: _converter(table, column) for role, column in columns.items()}, 0, table.n_rows)
    check_sizes(path, columns, signals)
    check_numbers(path, columns, signals)
    time = signals.get("time")
    if time is not None and not columns["time"].unit_known:
        check_assumed(path, columns["time"].name, time)
        notes.append(f"the time {columns['time'].name!r} is taken as seconds")
    return _Rows(columns, tilt, time, signals.renamed({role: role for role in columns if role != "time"}), notes)


def _converter(table: StoredColumns, column: Column) -> Reader:
    """Make what reads rows of a column in SI units."""

    def read(start: int, end: int) -> np.ndarray:
        with np.errstate(over="ignore"):
            return table.read(column.name.strip(), slice(start, end)) * column.factor + column.offset

    return read


def _cut(path: Path, rows: _Rows, time_range: tuple[float, float], rate: float | None) -> _Rows:
    """Return the rows between two times, counted from the earliest."""
    n = rows.signals.n_rows
    if rows.time is None:
        clock = np.arange(n) / (rate or 1.0)
    else:
        clock = rows.time - np.nanmin(np.where(np.isfinite(rows.time), rows.time, np.inf))
    start, end = time_range
    with np.errstate(invalid="ignore"):
        inside = (clock >= start - 1e-9) & (clock <= end + 1e-9)
    if not inside.any():
        raise InputError(f"--time-range {start:g}:{end:g}: {path} has no row there; it lasts {np.nanmax(clock):.6g} s")
    return replace(
        rows,
        time=None if rows.time is None else rows.time[inside],
        signals=masked(rows.signals, inside),
    )


def _measured(rows: _Rows) -> StoredColumns:
    """Return row by row the observers' measurements, by their names in a trajectory."""
    signals, measured = rows.signals, {}

    def of(formula: Callable[..., ArrayLike], *roles: str) -> Reader:
        return lambda start, end: np.asarray(formula(*(signals.read(role, slice(start, end)) for role in roles)))

    if rows.tilt is not None:
        angle = of(rows.tilt, *ACCELEROMETERS)
        measured["acceleration_rad_s2"] = of(rows.tilt.acceleration, "inner_x", "outer_x")
    else:
        one = "ax" in signals
        angle = of(tilt_of_one, *ONE_ACCELEROMETER) if one else of(np.asarray, "tilt")
        if "acceleration" in signals:
            measured["acceleration_rad_s2"] = of(np.asarray, "acceleration")
    whole = np.empty(signals.n_rows)
    for some in stretches(signals.n_rows):
        whole[some] = angle(some.start, some.stop)
    measured = {"y1_rad": shelved(unwrapped(whole, rows.notes)), **measured}
    if "gimbal" in signals:
        measured["y2_rad"] = of(np.asarray, "gimbal")
    elif "gimbal1" in signals:
        measured["y2_rad"] = of(lambda one, two: (one - two) / 2.0, "gimbal1", "gimbal2")
    if "command" in signals:
        measured["u_rad_s"] = of(np.asarray, "command")
    return StoredColumns(measured, 0, signals.n_rows)


def _signals_in(measured: StoredColumns, rows: _Rows) -> frozenset[str]:
    """Return which signals a log has, and note a gimbal without command or a command without gimbal."""
    gimbal, command = "y2_rad" in measured, "u_rad_s" in measured
    if gimbal != command:
        present, absent = ("gimbal", "command") if gimbal else ("command", "gimbal")
        rows.notes.append(f"there is a {present} and no {absent}: observers that need the gimbals need both")
    present = {
        "gimbals": gimbal and command,
        "acceleration": "acceleration_rad_s2" in measured,
        "reference": rows.referred,
    }
    return frozenset(name for name, known in present.items() if known)


def _join(parts: Sequence[Part], rows: _Rows, options: ReadOptions) -> Mapping[str, np.ndarray]:
    """Join all parts, with every column of a log."""
    n = sum(len(part.time) for part in parts)
    absent = {"y2_rad": 0.0, "u_rad_s": 0.0, "acceleration_rad_s2": math.nan}
    columns = {}
    for name in ("y1_rad", "y2_rad", "u_rad_s", "acceleration_rad_s2"):
        values = np.full(n, absent.get(name, 0.0))
        start = 0
        for part in parts:
            if name in part.values:
                values[start : start + len(part.time)] = part.values[name]
            start += len(part.time)
        columns[name] = shelved(values)
        del values
    columns[REFERENCE] = shelved(_reference(parts, rows, options) if rows.referred else np.full(n, np.nan))
    time = np.concatenate([part.time for part in parts])
    columns = {"time_s": shelved(time - parts[0].time[0] if abs(parts[0].time[0]) > 1e6 else time), **columns}
    joined = StoredColumns(columns, 0, n)
    return joined if n > LONG else dict(joined)


def _reference(parts: Sequence[Part], rows: _Rows, options: ReadOptions) -> np.ndarray:
    """Sample the reference where the parts are."""
    reference = rows.reference
    stamps = np.arange(len(reference)) / (options.rate_hz or 1.0) if rows.time is None else rows.time
    if not (known := np.isfinite(stamps)).all():
        stamps, reference = stamps[known], reference[known]
    if (np.diff(stamps) < 0.0).any():
        order = np.argsort(stamps, kind="stable")
        stamps, reference = stamps[order], reference[order]
    first = np.concatenate([[True], np.diff(stamps) > SAME_TIME * parts[0].step])
    if not first.all():
        stamps, reference = stamps[first], reference[first]
    sampled = np.empty(sum(len(part.time) for part in parts))
    start = 0
    for part in parts:
        when = np.empty(len(stamps))
        for some in stretches(len(stamps)):
            when[some] = part.when(stamps[some]) - options.delay_s
        sampled[start : start + len(part.time)] = sampled_where_known(part.time, when, reference)
        start += len(part.time)
    return sampled


def unwrapped(angle: np.ndarray, notes: list[str]) -> np.ndarray:
    """Unwrap an angle that starts again after a turn; a single row that leaps out and back is a spike, and stays."""
    present = np.isfinite(angle)
    steps = np.diff(angle if present.all() else angle[present])
    if not len(steps) or max(steps.max(), -steps.min()) <= UNWRAP_STEP:
        return angle
    known = np.flatnonzero(present)
    spikes = _spikes(angle[known])
    if len(spikes):
        rows = f"row {known[spikes[0]] + 1}"
        where = f"in {rows} alone" if len(spikes) == 1 else f"in {len(spikes):,} single rows, first {rows}"
        size = math.degrees(angle[known[spikes[0]]] - angle[known[spikes[0] - 1]])
        notes.append(f"the tilt leaps by {size:.4g} deg and back {where}: a spike, kept as it is")
    smooth = np.delete(known, spikes)
    jumps = int((np.abs(np.diff(angle[smooth])) > UNWRAP_STEP).sum())
    if not jumps:
        return angle
    notes.append(f"the tilt jumps by a turn {jumps:,} time{'' if jumps == 1 else 's'}: made to run on")
    out = angle.copy()
    out[smooth] = np.unwrap(angle[smooth])
    before = known[spikes - 1]
    out[known[spikes]] += out[before] - angle[before]
    return out


def _spikes(angle: np.ndarray) -> np.ndarray:
    """Return the places of single values that leap out and back and are no flicker near the end of a turn."""
    steps = np.diff(angle)
    out, back = steps[:-1], steps[1:]
    leaps = (np.abs(out) > UNWRAP_STEP) & (np.abs(back) > UNWRAP_STEP) & (out * back < 0.0)
    if not leaps.any():
        return np.flatnonzero(leaps)
    # Angles that start again lie within one turn; a leap out of that range, or by less than a turn, is a spike.
    others, middle = np.delete(angle, np.flatnonzero(leaps) + 1), angle[1:-1]
    reach = np.maximum(middle, others.max()) - np.minimum(middle, others.min())
    short = np.abs(np.abs(out) - 2.0 * math.pi) > 5.0 * np.median(np.abs(steps)) + FLICKER
    flickers = (reach < 2.0 * math.pi + 1e-6) & ~short
    return np.flatnonzero(leaps & ~flickers) + 1
