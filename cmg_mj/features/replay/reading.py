"""Reading of a log: a file's columns are converted, checked, sampled evenly and joined."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
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
    Channels,
    Column,
    Log,
    ReadOptions,
    Segment,
    Values,
    columns_of,
    read_table,
)
from cmg_mj.features.replay.sampling import FEW_REPEATED, HELD, MIN_RATE_HZ, reference_at, sample, select, unrounded
from cmg_mj.features.replay.white_noise import white_noise_of
from cmg_mj.results.trajectory import GYRO, Trajectory
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.scenario.rig_file import PlacedAccelerometer
from cmg_mj.stages.push import Window, inside, push_windows

BALANCED_HZ = 5.0
"""Rate below which nothing balances: milliseconds taken as seconds have at most this, up to 5 kHz [Hz]."""
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
    slowest = _slowest(columns, notes)
    for role, delay in options.rig.delays_s.items():
        if role not in signals:
            raise InputError(f"delays_s.{role}: there is no such column; {nearest(role, signals)}")
        signals[role] = _earlier(time, signals[role], delay)
    clipped = clipped_rows(signals, columns, notes)
    measured = _measured(signals, geometry, options.rig.accelerometer, notes)
    time = unrounded(time, measured["y1_rad"], notes)
    period, dt, segments = sample(path, time, measured, options, slowest, notes)
    if "torque" in signals:
        segments = [_turned(segment, dt) for segment in segments]
    joined = _join(segments)
    tilt = joined["y1_rad"]
    if np.ptp(tilt) == 0.0:
        raise InputError(f"{path}: the tilt is {tilt[0]:g} rad in every row: nothing moves")
    if "rate" in signals:
        unclipped = np.where(clipped, np.nan, signals["rate"])
        reference = joined[REFERENCE] = reference_at(segments, time, unclipped, options.delay_s)
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
    _, dt, segments = sample(path, time, {**signals, "y1_rad": paced}, options, _slowest(columns, notes), notes)
    longest = max(segments, key=lambda segment: len(segment.time))
    if len(segments) > 1:
        start, end = longest.time[[0, -1]] - time[0]
        notes.append(f"{start:.4g} to {end:.4g} s is used, the longest of {len(segments)} parts without a gap")
    units = {role: column.unit or "s" for role, column in columns.items() if role in options.columns}
    return Channels(path.stem, dt, longest.values, replace(options, units=units), notes)


def _slowest(columns: Mapping[str, Column], notes: list[str]) -> float:
    """Return the lowest rate of rows: without a unit of the times, milliseconds are not taken as seconds [Hz]."""
    if "time" not in columns or columns["time"].unit is not None:
        return MIN_RATE_HZ
    notes.append(f"the time {columns['time'].name!r} is taken as seconds")
    return BALANCED_HZ


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
    return counted[: rows.sum()] if time is None else time[rows], select(signals, rows)


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
    """Return values with NaN for a few that are one number, such as -999, far beyond all others: no knock is."""
    sizes = np.unique(values[np.isfinite(values)])
    if len(sizes) > 2:
        at = int(np.argmax(np.diff(sizes)))
        low, high = sizes[at : at + 2]
        is_high = np.mean(values > low) < FEW_REPEATED
        rest = np.ptp(sizes[: at + 1] if is_high else sizes[at + 1 :])
        away = values > low if is_high else values < high
        far = 10.0 if away.sum() == 1 else 1.0
        if 0.0 < far * rest < high - low and 0.0 < away.mean() < FEW_REPEATED and np.ptp(values[away]) == 0.0:
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
