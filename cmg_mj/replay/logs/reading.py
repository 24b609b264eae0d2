"""A file -> a log: its columns converted, checked, sampled evenly and joined."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.replay.logs.checks import (
    accelerometer_geometry,
    check_assumed,
    check_motion,
    check_numbers,
    check_sizes,
    windows_inside,
)
from cmg_mj.replay.logs.columns import ACCELEROMETERS, Column, columns_of
from cmg_mj.replay.logs.from_run import of_trajectory
from cmg_mj.replay.logs.log import REFERENCE, Log
from cmg_mj.replay.logs.resampling import sampled_where_known
from cmg_mj.replay.logs.sampling import SAME_TIME, Part, Sampler
from cmg_mj.replay.logs.swapped_accelerometers import HINT, interchanged
from cmg_mj.replay.logs.table import read_table
from cmg_mj.replay.logs.unit_checks import beside_the_tilt, of_gravity
from cmg_mj.replay.logs.units import in_si
from cmg_mj.replay.logs.unwrapping import turned
from cmg_mj.scenario.disturbances import Window
from cmg_mj.sensors.tilt import RadialTilt


def read_log(
    path: Path | str,
    columns: Mapping[str, str] | None = None,
    *,
    units: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    offset: Mapping[str, float] | None = None,
    rate_hz: float | None = None,
    max_gap_s: float | None = None,
    delay_s: float = 0.0,
    radii_m: tuple[float, float] | None = None,
    between_s: tuple[float, float] | None = None,
    windows_s: Sequence[Window] = (),
) -> Log:
    """Read a log.

    Args:
        path: A CSV with a heading, a Parquet file, or a run's folder or `trajectory.parquet`, whose columns are known.
        columns: Role -> heading, such as `{"tilt": "pitch_deg", "rate": "gyro_dps"}`; the roles: `ROLES`.
        units: Role -> unit, for headings that do not end in theirs.
        scale: Role -> factor.
        offset: Role -> what is added after that, in the column's unit.
        rate_hz: The rate of rows without a time; of rows with one, that to resample to [Hz].
        max_gap_s: Longer gaps part the log; by default those of more than five rows [s].
        delay_s: How far the reference lags behind the rest [s].
        radii_m: Of two accelerometers, the distances from the pivot, the inner first [m].
        between_s: From when to when, from the first row on [s].
        windows_s: What is scored on its own as well, in the log's own time [s].

    Returns:
        The log.

    Raises:
        InputError: Something is wrong with the file or the arguments.
    """
    path = Path(path)
    if path.is_dir() and (path / "trajectory.parquet").is_file():
        path = path / "trajectory.parquet"
    if not columns:
        log = of_trajectory(path)
        told = {"--units": units, "--scale": scale, "--offset": offset, "--rate": rate_hz, "--max-gap": max_gap_s}
        told |= {"--delay": delay_s, "--radii": radii_m, "--between": between_s}
        for option, value in told.items():
            if value not in (None, 0.0, {}):
                raise InputError(f"{option}: {path} is a run's own recording; read it with --columns for that")
        return log if not windows_s else replace(log, windows=windows_inside(path, windows_s, log["time_s"]))
    found = columns_of(columns, units, scale, offset)
    tilt = accelerometer_geometry(found, radii_m)
    if not math.isfinite(delay_s):
        raise InputError(f"--delay {delay_s:g}: must be a finite number of seconds")
    if delay_s and "rate" not in found:
        raise InputError("--delay: there is no reference to shift; name it, --columns rate=...")
    headings = [column.name for column in found.values()]
    table, notes, dated = read_table(path, headings, found["time"].name if "time" in found else None)
    if dated:  # seconds already, whatever the heading ends in
        clock = found["time"]
        found["time"] = replace(clock, unit="s", factor=clock.factor / in_si("time", clock.unit), told=True)
    with np.errstate(over="ignore"):
        raw = {role: table[column.name.strip()] * column.factor + column.offset for role, column in found.items()}
    check_sizes(path, found, raw)
    check_numbers(path, found, raw)
    time = raw.pop("time", None)
    if time is not None and not found["time"].told:
        check_assumed(path, found["time"].name, time)
        notes.append(f"the time {found['time'].name!r} is taken as seconds")
    reference = raw.pop("rate", None)
    if between_s is not None:
        time, raw, reference = _between(path, time, raw, reference, between_s, rate_hz)
    measured = _measured(raw, tilt, notes)
    sampler = Sampler(str(path), rate_hz, max_gap_s, notes)
    dt, parts = sampler.parts(time, measured, held=("u_rad_s",))
    stamps = np.arange(len(measured["y1_rad"])) / (rate_hz or 1.0) if time is None else time
    joined = _joined(parts, stamps, reference, delay_s)
    check_motion(path, joined, reference is not None)
    has = {"gimbals"} if "u_rad_s" in measured and "y2_rad" in measured else set()
    has |= {"acceleration"} if "acceleration_rad_s2" in measured else set()
    has |= {"reference"} if reference is not None else set()
    _say_halves(found, has, notes)
    ends = np.cumsum([len(part.time) for part in parts]).tolist()
    given = {
        "columns": {role: column.name for role, column in found.items()},
        "units": {role: column.unit for role, column in found.items()},
        **({"scale": dict(scale)} if scale else {}),
        **({"offset": dict(offset)} if offset else {}),
        **({"rate_hz": rate_hz} if rate_hz else {}),
        **({"max_gap_s": max_gap_s} if max_gap_s is not None else {}),
        **({"delay_s": delay_s} if delay_s else {}),
        **({"radii_m": list(radii_m)} if radii_m else {}),
        **({"between_s": list(between_s)} if between_s else {}),
        **({"windows_s": [list(window) for window in windows_s]} if windows_s else {}),
    }
    if windows_s and reference is None:
        raise InputError("--window: there is no reference to score against; name it, --columns rate=...")
    windows = windows_inside(path, windows_s, joined["time_s"])
    slices = [slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
    if "acceleration" in has:
        notes += _implausible(found, raw, joined, slices, dt, tilt)
    return Log(path.stem, dt, joined, slices, frozenset(has), tilt, windows, tuple(notes), given, None, sampler.period)


def _between(
    path: Path,
    time: np.ndarray | None,
    raw: dict[str, np.ndarray],
    reference: np.ndarray | None,
    between: tuple[float, float],
    rate: float | None,
) -> tuple[np.ndarray | None, dict[str, np.ndarray], np.ndarray | None]:
    """The rows between two times, counted from the earliest."""
    n = len(next(iter(raw.values())))
    clock = (
        np.arange(n) / (rate or 1.0) if time is None else time - np.nanmin(np.where(np.isfinite(time), time, np.inf))
    )
    with np.errstate(invalid="ignore"):
        kept = (clock >= between[0] - 1e-9) & (clock <= between[1] + 1e-9)
    if not kept.any():
        raise InputError(
            f"--between {between[0]:g}:{between[1]:g}: {path} has no row there; it lasts {np.nanmax(clock):.6g} s"
        )
    cut = {role: values[kept] for role, values in raw.items()}
    return None if time is None else time[kept], cut, None if reference is None else reference[kept]


def _measured(raw: Mapping[str, np.ndarray], tilt: RadialTilt | None, notes: list[str]) -> dict[str, np.ndarray]:
    """Row by row what the observers are given, by its name in a trajectory."""
    found: dict[str, np.ndarray] = {}
    if tilt is not None:
        forces = [raw[role] for role in ACCELEROMETERS]
        found["y1_rad"] = turned(np.asarray(tilt(*forces)), notes)
        found["acceleration_rad_s2"] = np.asarray(tilt.acceleration(raw["inner_x"], raw["outer_x"]))
    else:
        found["y1_rad"] = turned(raw["tilt"], notes)
        if "acceleration" in raw:
            found["acceleration_rad_s2"] = raw["acceleration"]
    if "gimbal" in raw:
        found["y2_rad"] = raw["gimbal"]
    elif "gimbal1" in raw:
        found["y2_rad"] = (raw["gimbal1"] - raw["gimbal2"]) / 2.0
    if "command" in raw:
        found["u_rad_s"] = raw["command"]
    return found


def _joined(
    parts: Sequence[Part], stamps: np.ndarray, reference: np.ndarray | None, delay: float
) -> dict[str, np.ndarray]:
    """All parts, one behind the other, with every column of a log."""
    time = np.concatenate([part.time for part in parts])
    columns = {"time_s": time - parts[0].time[0] if abs(parts[0].time[0]) > 1e6 else time}
    absent = {"y2_rad": 0.0, "u_rad_s": 0.0, "acceleration_rad_s2": math.nan}
    for name in ("y1_rad", "y2_rad", "u_rad_s", "acceleration_rad_s2"):
        values = [part.values.get(name, np.full(len(part.time), absent.get(name, 0.0))) for part in parts]
        columns[name] = np.concatenate(values)
    columns[REFERENCE] = np.full(len(time), np.nan)
    if reference is not None:
        known = np.isfinite(stamps)
        stamps, reference = stamps[known], reference[known]
        order = np.argsort(stamps, kind="stable")
        stamps, reference = stamps[order], reference[order]
        first = np.concatenate([[True], np.diff(stamps) > SAME_TIME * parts[0].step])
        stamps, reference = stamps[first], reference[first]
        columns[REFERENCE] = np.concatenate(
            [sampled_where_known(part.time, part.when(stamps) - delay, reference) for part in parts]
        )
    return columns


def _implausible(
    found: Mapping[str, Column],
    raw: Mapping[str, np.ndarray],
    joined: Mapping[str, np.ndarray],
    parts: Sequence[slice],
    dt: float,
    places: RadialTilt | None,
) -> list[str]:
    """What the accelerations cannot be; of several mistakes that hang together, the first."""
    y, a = joined["y1_rad"], joined["acceleration_rad_s2"]
    if places is not None:
        said = of_gravity(found, raw, places)
        if said or interchanged(y, a, parts, dt, places):
            return [said or HINT]
    said = beside_the_tilt(y, a, parts, dt, found)
    return [said] if said else []


def _say_halves(found: Mapping[str, Column], has: set[str], notes: list[str]) -> None:
    """What is named, but not enough to be used."""
    gimbal = "gimbal" in found or "gimbal1" in found
    if gimbal != ("command" in found):
        there, lacks = ("gimbal", "command") if gimbal else ("command", "gimbal")
        notes.append(f"there is a {there} and no {lacks}: observers that need the gimbals need both")
