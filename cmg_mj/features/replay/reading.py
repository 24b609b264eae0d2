"""Reading of a log: a file's columns are converted, checked, sampled evenly and joined."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from cmg_mj.core.errors import InputError, counted, nearest
from cmg_mj.core.planar_tilt import PlanarTilt
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.replay.clipping import clipped_rows
from cmg_mj.features.replay.log import (
    ACCELEROMETERS,
    EVEN,
    ONE_ACCELEROMETER,
    REFERENCE,
    TORQUE_MOMENTUM,
    UNITS,
    Channels,
    Log,
    ReadOptions,
    Segment,
    Values,
    columns_of,
    read_table,
)
from cmg_mj.features.replay.noise import white_noise_of
from cmg_mj.features.replay.rig import PlacedAccelerometer
from cmg_mj.results.trajectory import GYRO, Trajectory
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.stages.push import Window, inside, push_windows

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
BALANCED_HZ = 5.0
"""Rate below which nothing balances: milliseconds taken as seconds have at most this, up to 5 kHz [Hz]."""
MAX_BALANCED_HZ = 2e4
"""Rate above which no log of such a rig is sampled [Hz]."""
MAX_SAMPLES = 5_000_000
"""More samples of a log take hours."""
HELD = "u_rad_s"
"""The signal that holds until the next row."""
UNWRAP_STEP = 1.5 * math.pi
"""A larger step of the tilt from one row to the next is a wrapped angle, not a motion [rad]."""
MAX_DELAY_S = 1e6
"""Longest delay of a reference [s]."""
MAX_RADIUS_M = 10.0
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
        raise InputError(
            f"{path}: no plain file; name a CSV or Parquet file, or the folder of a run. Save what a pipe sends"
        )
    if not options.columns:
        return _read_run(path, options)
    columns = columns_of(options)
    if ("inner_x" in columns) != (options.radii_m is not None):
        raise InputError("--radii INNER,OUTER [m] and --columns inner_x, inner_z, outer_x, outer_z go together")
    inner, outer = options.radii_m or (0.0, MAX_RADIUS_M)
    if not 0.0 <= inner < outer <= MAX_RADIUS_M:
        raise InputError(
            f"--radii {inner:g},{outer:g}: must be two distances from the pivot, the smaller first, at most "
            f"{MAX_RADIUS_M:g} m"
        )
    geometry = _geometry(options)
    if "torque" in columns and not str(columns["torque"].unit).endswith("n_m"):
        raise InputError("--units torque=a: observers take a torque: --units torque=n_m --scale torque=N_M_PER_A")
    if not abs(options.delay_s) <= MAX_DELAY_S:
        raise InputError(f"--delay {options.delay_s:g}: must be from -{MAX_DELAY_S:g} to {MAX_DELAY_S:g} s")
    if "rate" not in columns and (options.delay_s or options.windows_s):
        raise InputError("--delay, --window: there is no reference; name it, --columns rate=...")
    notes: list[str] = []
    time, signals = _times(path, read_table(path, columns, options), options, notes)
    slowest = MIN_RATE_HZ
    if "time" in columns and columns["time"].unit is None:
        notes.append(f"the time {columns['time'].name!r} is taken as seconds")
        slowest = BALANCED_HZ
    for role, delay in options.rig.delays_s.items():
        if role not in signals:
            raise InputError(f"delays_s.{role}: there is no such column; {nearest(role, signals)}")
        signals[role] = _earlier(time, signals[role], delay)
    clipped = clipped_rows(signals, columns, notes)
    measured = _measured(signals, geometry, options.rig.accelerometer, notes)
    time = _unrounded(time, measured["y1_rad"], notes)
    period, dt, segments = _sample(path, time, measured, options, slowest, notes)
    if "torque" in signals:
        segments = [_turned(segment, dt) for segment in segments]
    joined = _join(segments)
    tilt = joined["y1_rad"]
    if np.ptp(tilt) == 0.0:
        raise InputError(f"{path}: the tilt is {tilt[0]:g} rad in every row: nothing moves")
    if "rate" in signals:
        unclipped = np.where(clipped, np.nan, signals["rate"])
        reference = joined[REFERENCE] = _reference(segments, time, unclipped, options.delay_s)
        known = reference[np.isfinite(reference)]
        if not len(known):
            raise InputError(f"{path}: the reference has no number where the tilt has one")
        if np.ptp(known) == 0.0:
            raise InputError(f"{path}: the reference is {known[0]:g} rad/s in every row: leave it out")
    roles = {role: signals[role] for role in columns if role in options.columns and role != "time"}
    notes += _gravity_remarks(roles, options.scale)
    if "ax" in roles:
        notes.append("the tilt is atan2(-ax, az): an acceleration of the sensor by 0.1 g puts it off by 5.7 deg")
    needed = {"gimbals": {"y2_rad", HELD}, "acceleration": {"acceleration_rad_s2"}}
    needed |= {"gyro": {GYRO}, "reference": {"rate"}}
    ends = np.cumsum([0, *(len(segment.time) for segment in segments)]).tolist()
    return Log(
        path.stem,
        dt,
        joined,
        [slice(start, end) for start, end in pairwise(ends)],
        frozenset(name for name, columns in needed.items() if columns <= {*measured, *signals}),
        tilt=geometry,
        windows=_windows_inside(path, options.windows_s, joined["time_s"]),
        notes=tuple(notes),
        options=replace(options, units={role: column.unit or "s" for role, column in columns.items()}),
        row_period_s=period,
        white_noise=white_noise_of(
            segments, period, dt, 0.0 if geometry is None or geometry.has_angle else geometry.noise().correlation
        ),
    )


def read_channels(path: Path | str, options: ReadOptions) -> Channels:
    """Read a log's columns as they are, evenly sampled, in the longest part without a gap.

    Args:
        path: A CSV with a heading, or a Parquet file.
        options: The columns of the file; of its accelerometers only columns and units count.

    Raises:
        InputError: Something is wrong with the file or the options.
    """
    path, notes = Path(path), list[str]()
    columns = columns_of(options)
    time, signals = _times(path, read_table(path, columns, options), options, notes)
    sensors = {role: values for role, values in signals.items() if role == "rate" or role not in options.columns}
    if sensors and clipped_rows(sensors, columns, notes).any():
        raise InputError(f"{path}: {notes[-1].partition(':')[0]}: clipped; leave that out, --time-range START:END")
    if "tilt" in signals:
        signals["tilt"] = _unwrapped(signals["tilt"], notes)
    paced = signals.get("tilt", next(values for values in signals.values()))
    _, dt, segments = _sample(path, time, {**signals, "y1_rad": paced}, options, MIN_RATE_HZ, notes)
    longest = max(segments, key=lambda segment: len(segment.time))
    if len(segments) > 1:
        start, end = longest.time[[0, -1]] - time[0]
        notes.append(f"{start:.4g} to {end:.4g} s is used, the longest of {len(segments)} parts without a gap")
    units = {role: column.unit or "s" for role, column in columns.items() if role in options.columns}
    return Channels(path.stem, dt, longest.values, replace(options, units=units), notes)


def _read_run(path: Path, options: ReadOptions) -> Log:
    """Read a run's own recording, whose columns, pushes and scenario are known."""
    names = ("time_s", "y1_rad", "y2_rad", "u_rad_s", "acceleration_rad_s2", "x2_rad_s")
    try:
        trajectory = Trajectory.load(path)
        scenario = trajectory.metadata["scenario"]
        run = parse_scenario(dict(scenario), str(path))
        names += (GYRO,) if GYRO in trajectory else ()
        columns = {name: trajectory[name] for name in names if not trajectory.axes}
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: no recording of a run; say which columns are what, --columns tilt=HEADING,rate=HEADING,..."
        ) from error
    if trajectory.axes:
        raise InputError(
            f"{path}: a run about several axes ({', '.join(trajectory.axes)}), and replay takes one; run it with the "
            f'others locked, as with --set plant.locked_axes=["{trajectory.axes[-1]}"]'
        )
    given = [field for field in options.as_toml() if field != "windows_s"]
    if given:
        raise InputError(f"{path}: {given[0]} is for other logs than a run's own recording; read it with --columns")
    time, dt = columns["time_s"], 1.0 / run.controller.rate_hz
    with np.errstate(invalid="ignore"):
        even = np.allclose(np.diff(time), dt, rtol=0.0, atol=EVEN * dt)
    if not even:
        raise InputError(f"{path}: time_s: its rows are not {dt:g} s apart, as controller.rate_hz has it")
    return Log(
        path.parent.name if path.stem == "trajectory" and path.parent.name else path.stem,
        dt,
        {**columns, REFERENCE: columns.pop("x2_rad_s")},
        [slice(0, len(time))],
        frozenset({"gimbals", "acceleration", "reference", *(["gyro"] if GYRO in trajectory else [])}),
        windows=_windows_inside(path, options.windows_s, time) or push_windows(run.push),
        scenario=scenario,
    )


def read_logs(paths: Sequence[str], options: ReadOptions) -> list[Log]:
    """Read logs, and refuse one that is named twice: `tune-log` would count it twice."""
    files = [os.path.realpath(path).removesuffix("/trajectory.parquet") for path in paths]
    for i, path in enumerate(paths):
        if files[i] in files[:i]:
            raise InputError(f"{path}: this log is given twice")
    return [read_log(path, options) for path in paths]


def _windows_inside(path: Path, windows: Sequence[Window], time: np.ndarray) -> tuple[Window, ...]:
    """Check that each window holds a sample, and return the windows."""
    for start, end in windows:
        if not inside(time, [(start, end)]).any():
            ends = f"{time[0]:.6g} to {time[-1]:.6g} s"
            raise InputError(f"--window {start:g}:{end:g}: {path} has no sample there; it goes from {ends}")
    return tuple(windows)


def _times(
    path: Path, signals: dict[str, np.ndarray], options: ReadOptions, notes: list[str]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the rows' times, (n_rows,) [s], and their other signals, of the time range alone."""
    time = signals.pop("time", None)
    for role in sorted(signals.keys() - {"command", "torque"}):  # which may be 0 but for one step
        signals[role] = _known(role, signals[role], notes)
    if time is None and options.rate_hz is None:
        raise InputError(f"{path}: no time: name its column, --columns time=..., or give --rate HZ")
    counted = np.arange(len(next(iter(signals.values())))) / (options.rate_hz or 1.0)
    if options.time_range_s is None:
        return counted if time is None else time, signals
    start, end = options.time_range_s
    clock = counted if time is None else time - np.nanmin(time)
    rows = (clock >= start - 1e-9) & (clock <= end + 1e-9)
    if not rows.any():
        raise InputError(f"--time-range {start:g}:{end:g}: {path} has no row there; it lasts {np.nanmax(clock):.6g} s")
    return counted[: rows.sum()] if time is None else time[rows], _select(signals, rows)


def _geometry(options: ReadOptions) -> PlanarTilt | None:
    """Return the accelerometers' geometry, if their places are known."""
    placed, sigmas = [complex(*one.place_m) for one in options.rig.accelerometer], [1.0]
    if options.radii_m:
        placed = [complex(0.0, radius) for radius in options.radii_m]
    elif all(one.noise_m_s2 for one in options.rig.accelerometer):
        sigmas = [one.noise_m_s2 or 1.0 for one in options.rig.accelerometer]
    if not placed:
        return None
    sigmas = tuple(sigmas) * (len(placed) // len(sigmas))
    return PlanarTilt(tuple(placed), sigmas, STANDARD_GRAVITY, "tilt" in options.columns, options.rig.pivot_moves)


def _measured(
    signals: Values, geometry: PlanarTilt | None, placed: Sequence[PlacedAccelerometer], notes: list[str]
) -> dict[str, np.ndarray]:
    """Return row by row the observers' measurements, by their names in a trajectory."""
    acceleration = signals.get("acceleration")
    if geometry is not None:
        forces = [one.force(*(signals[heading] for heading in one.columns)) for one in placed] or [
            signals[f"{which}_x"] + 1j * signals[f"{which}_z"] for which in ("inner", "outer")
        ]
        angle, acceleration = geometry(forces, signals.get("tilt"))
    else:
        angle = np.arctan2(-signals["ax"], signals["az"]) if "ax" in signals else signals["tilt"]
    measured = {"y1_rad": _unwrapped(angle, notes)}
    if acceleration is not None:
        measured["acceleration_rad_s2"] = acceleration
    if "gimbal" in signals:
        measured["y2_rad"] = signals["gimbal"]
    elif "gimbal1" in signals:
        measured["y2_rad"] = (signals["gimbal1"] - signals["gimbal2"]) / 2.0
    if "gyro" in signals:
        measured[GYRO] = signals["gyro"]
    if "command" in signals:
        measured[HELD] = signals["command"]
    if "torque" in signals:  # of f2 in (4) it is u times a momentum, at upright gimbals
        return {**measured, HELD: signals["torque"] / TORQUE_MOMENTUM, "y2_rad": 0.0 * signals["torque"]}
    if ("y2_rad" in measured) != (HELD in measured):
        notes.append("observers that need the gimbals need both gimbal and command; there is one of them")
    return measured


def _known(name: str, values: np.ndarray, notes: list[str]) -> np.ndarray:
    """Return values with NaN for a few, such as -999, that are further from all others than those are apart."""
    sizes = np.unique(values[np.isfinite(values)])
    if len(sizes) > 2:
        at = int(np.argmax(np.diff(sizes)))
        low, high = sizes[at : at + 2]
        is_high = np.mean(values > low) < FEW_REPEATED
        rest = np.ptp(sizes[: at + 1] if is_high else sizes[at + 1 :])
        away = values > low if is_high else values < high
        if 0.0 < rest < high - low and 0.0 < away.mean() < FEW_REPEATED:
            notes.append(
                f"{counted(away.sum(), 'row')} of {name!r} beside all others, as {values[away][0]:g}: no number"
            )
            return _known(name, np.where(away, math.nan, values), notes)
    return values


def _unwrapped(angle: np.ndarray, notes: list[str]) -> np.ndarray:
    """Unwrap an angle that starts again after a turn, and note it."""
    known, out = np.isfinite(angle), angle.copy()
    jumps = int((np.abs(np.diff(out[known])) > UNWRAP_STEP).sum())
    if jumps:
        notes.append(f"the tilt jumps by a turn {counted(jumps, 'time')}: made to run on")
        out[known] = np.unwrap(out[known])
    elif known.any() and np.ptp(out[known]) > 2.0 * math.pi:
        notes.append(f"the tilt covers {np.ptp(out[known]):.3g} rad; if these are degrees, --units tilt=deg")
    return out


def _unrounded(time: np.ndarray, angle: np.ndarray, notes: list[str]) -> np.ndarray:
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


def _sample(
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
        _segment(time[rows], _select(values, rows), gap, dt, resampled)
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
        time, values = time[present], _select(values, present)
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
        time, values = time[later], _select(values, later)
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
            time, places, values = time[later], places[later], _select(values, later)
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


def _select(values: Values, rows: slice | np.ndarray) -> dict[str, np.ndarray]:
    return {name: column[rows] for name, column in values.items()}


def _turned(segment: Segment, dt: float) -> Segment:
    """Return a segment with the angle of the gimbal that a known torque stands for."""
    return replace(segment, values={**segment.values, "y2_rad": dt * np.cumsum([0.0, *segment.values[HELD][:-1]])})


def _earlier(time: np.ndarray, values: np.ndarray, delay_s: float) -> np.ndarray:
    """Return what a column that comes so late shows at each row; NaN where it does not say [s]."""
    known = np.isfinite(time) & np.isfinite(values)
    return np.interp(time + delay_s, time[known], values[known], math.nan, math.nan)


def _join(segments: Sequence[Segment]) -> dict[str, np.ndarray]:
    """Join all segments, with every column of a log."""
    time = np.concatenate([segment.time for segment in segments])
    columns = {"time_s": time - time[0] if abs(time[0]) > 1e6 else time}
    absent = {"y1_rad": 0.0, "y2_rad": 0.0, HELD: 0.0}
    absent |= dict.fromkeys(("acceleration_rad_s2", GYRO, REFERENCE), math.nan)
    for name, value in absent.items():
        columns[name] = np.concatenate([some.values.get(name, np.full(len(some.time), value)) for some in segments])
    return columns


def _reference(segments: Sequence[Segment], time: np.ndarray, reference: np.ndarray, delay_s: float) -> np.ndarray:
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


def _gravity_remarks(signals: Values, scale: Mapping[str, float]) -> list[str]:
    """Compare the size and the sign of each accelerometer's specific force with gravity's, by their medians.

    Returns:
        A line for each that is wrong, with the options that cure it.
    """
    remarks = []
    for x, z in (ACCELEROMETERS[:2], ACCELEROMETERS[2:], ONE_ACCELEROMETER):
        if x not in signals:
            continue
        size = float(np.nanmedian(np.hypot(signals[x], signals[z]))) / STANDARD_GRAVITY
        across, upward = (float(np.nanmedian(signals[role])) / STANDARD_GRAVITY for role in (x, z))
        now = {role: scale.get(role, 1.0) for role in (x, z)}
        if size > 0.0 and not NEAR[0] <= size <= NEAR[1]:
            cure = ",".join(f"{role}={factor / size:.4g}" for role, factor in now.items())
            remarks.append(
                f"the specific force of {x} and {z} is {size:.4g} times gravity's 9.81 m/s^2: --scale {cure}"
            )
        elif abs(across) > NEAR[0] > abs(upward):
            raise InputError(f"--columns {x}, {z}: gravity lies along {x}, {across:.2g} g in the median: swap the two")
        elif upward < 0.0:
            turned = ",".join(f"{role}={-factor:g}" for role, factor in now.items())
            remarks.append(
                f"the median of {z} is {upward:.2g} g, so the tilt is beyond 90 deg: --scale {turned} if the sensor "
                f"shows gravity itself, --scale {z}={-now[z]:g} if it is upside down"
            )
    return remarks
