"""Reading of a log: a file's columns are converted, checked, sampled evenly and joined."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.tilt import RadialTilt
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.replay.log import REFERENCE, Log, ReadOptions, log_of_run
from cmg_mj.features.replay.noise import white_noise_of
from cmg_mj.features.replay.sampling import SAME_TIME, Part, Sampler, sampled_where_known
from cmg_mj.features.replay.table import ACCELEROMETERS, ONE_ACCELEROMETER, ROLES, UNITS, Column, columns_of, read_table
from cmg_mj.stages.push import Window, inside

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
