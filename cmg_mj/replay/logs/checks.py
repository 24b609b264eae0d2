"""Checks that refuse an impossible or an uninformative log in one line."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from cmg_mj.core.tilt import RadialTilt
from cmg_mj.errors import InputError
from cmg_mj.replay.logs.columns import Column
from cmg_mj.replay.logs.log import REFERENCE
from cmg_mj.stages.push import Window, inside

LARGEST = 1e12
"""Largest value of a signal, times since 1970 included [rad, rad/s, m/s^2, s]."""
SLOW_HZ = 5.0
"""Rate below which nothing balances; rows in milliseconds taken as seconds have at most this, up to 5 kHz [Hz]."""
FARTHEST_M = 10.0
"""Largest distance of an accelerometer from the pivot; millimetres taken as metres are larger [m]."""


def check_distinct_logs(paths: Sequence[str]) -> None:
    """Refuse a log that is named twice: it would count twice in means and intervals."""
    names: dict[Path, str] = {}
    for name in paths:
        path = Path(os.path.realpath(name))
        path = path.parent if path.name == "trajectory.parquet" else path
        if path in names:
            message = f"{name}: the same log as {names[path]}" if name != names[path] else f"{name}: given twice"
            raise InputError(message)
        names[path] = name


def accelerometer_geometry(columns: Mapping[str, Column], radii: tuple[float, float] | None) -> RadialTilt | None:
    """Return the geometry of the accelerometers; None if there are none."""
    if "inner_x" not in columns:
        if radii is not None:
            raise InputError("--radii: there are no accelerometers; name inner_x, inner_z, outer_x, outer_z")
        return None
    if radii is None:
        raise InputError("--columns inner_x: say how far from the pivot the two are, --radii INNER,OUTER [m]")
    inner, outer = radii
    if not (0.0 <= inner < outer < math.inf):
        raise InputError(f"--radii {inner:g},{outer:g}: must be two distances from the pivot [m], the smaller first")
    if outer > FARTHEST_M:
        raise InputError(f"--radii {inner:g},{outer:g}: in metres, at most {FARTHEST_M:g}; are these millimetres?")
    return RadialTilt(inner, outer)


def windows_inside(path: Path, windows: Sequence[Window], time: np.ndarray) -> tuple[Window, ...]:
    """Check that each window holds a sample, and return the windows."""
    for start, end in windows:
        if not inside(time, [(start, end)]).any():
            ends = f"{time[0]:.6g} to {time[-1]:.6g} s"
            raise InputError(f"--window {start:g}:{end:g}: {path} has no sample there; it goes from {ends}")
    return tuple(windows)


def check_sizes(path: Path, columns: Mapping[str, Column], signals: Mapping[str, np.ndarray]) -> None:
    """Refuse numbers so large that formulas overflow."""
    for role, values in signals.items():
        beyond = np.abs(values) > LARGEST
        if beyond.any():
            row = int(np.argmax(beyond))
            where = f"{path}: row {row + 1}, column {columns[role].name!r}"
            raise InputError(f"{where}: {values[row]:.3g} in SI units is no {role}; at most {LARGEST:g}")


def check_numbers(path: Path, columns: Mapping[str, Column], signals: Mapping[str, np.ndarray]) -> None:
    """Refuse a column without a number."""
    for role, values in signals.items():
        if not np.isfinite(values).any():
            raise InputError(f"{path}: column {columns[role].name!r}, the {role}, has no number at all")


def check_assumed(path: Path, name: str, time: np.ndarray) -> None:
    """Refuse times of unknown unit that would be slow in seconds: they are probably milliseconds."""
    steps = np.abs(np.diff(time[np.isfinite(time)]))
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual * SLOW_HZ > 1.0:
        raise InputError(
            f"{path}: in seconds the rows of {name!r} would be {usual:.4g} s apart, {1.0 / usual:.3g} Hz, and no unit "
            "is said: --units time=ms, or time=s if that is right"
        )


def check_motion(path: Path, columns: Mapping[str, np.ndarray], referred: bool) -> None:
    """Refuse a log without motion."""
    tilt = columns["y1_rad"]
    if np.ptp(tilt) == 0.0:
        raise InputError(f"{path}: the tilt is {tilt[0]:g} rad in every row: nothing moves")
    del tilt  # a long log's columns are read one by one
    reference = columns[REFERENCE]
    known = reference[np.isfinite(reference)]
    if referred and not len(known):
        raise InputError(f"{path}: the reference has no number where the tilt has one")
    if referred and np.ptp(known) == 0.0:
        raise InputError(f"{path}: the reference is {known[0]:g} rad/s in every row: leave it out")
