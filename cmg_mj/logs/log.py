"""A log: what was measured, evenly sampled, in the names and units of a trajectory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.logs.columns import ACCELEROMETERS, Column, columns_of
from cmg_mj.logs.sampling import SAME_TIME, Part, Sampler, sampled_where_known
from cmg_mj.logs.table import read_table
from cmg_mj.push import Push, Window, inside, push_windows
from cmg_mj.tilt import RadialTilt
from cmg_mj.trajectory import Trajectory
from cmg_mj.units import in_si

REFERENCE = "reference_rad_s"
"""The column of the rate that estimates are judged against; NaN where it is not known."""
SAY_COLUMNS = "say which columns are what, --columns tilt=HEADING,rate=HEADING,..."
LARGEST = 1e12
"""Of anything measured, times since 1970 included [rad, rad/s, m/s^2, s]."""
SLOW_HZ = 5.0
"""No rate of anything that balances; rows in milliseconds taken as seconds have at most this, from 5 kHz down [Hz]."""
FARTHEST_M = 10.0
"""Of an accelerometer from the pivot: nothing so large is balanced, and millimetres taken as metres are larger [m]."""
A_TURN = 1.5 * math.pi
"""A larger step of the tilt from one row to the next is an angle that starts again, not a motion [rad]."""

A_FLICKER = 0.2
"""Noise makes an angle near the end of its turn come back at once, a turn less at most so much away [rad]."""


@dataclass(frozen=True)
class Log:
    """One log.

    Attributes:
        name: Of the file, without its ending.
        dt: Sample period [s].
        columns: `time_s`, `y1_rad`, `y2_rad`, `u_rad_s`, `acceleration_rad_s2`, `reference_rad_s`, each (n,). Of what
            the log does not have, y2 and u are zero, the others NaN.
        parts: Where no gap is in between: the observers start at the beginning of each.
        has: What the log has of "gimbals" (y2 and u), "acceleration" and "reference".
        tilt: Where the two accelerometers are, if the tilt is theirs.
        windows: What is scored on its own as well [s].
        notes: What was done to the rows that nobody has asked for, a line each.
        given: From what it was read, for a file to tell.
        scenario: Of a trajectory the scenario, resolved.
    """

    name: str
    dt: float
    columns: Mapping[str, np.ndarray]
    parts: Sequence[slice]
    has: frozenset[str]
    tilt: RadialTilt | None = None
    windows: Sequence[Window] = ()
    notes: Sequence[str] = ()
    given: Mapping[str, Any] = field(default_factory=dict)
    scenario: Mapping[str, Any] | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    @property
    def duration_s(self) -> float:
        """Without the gaps [s]."""
        return sum(part.stop - part.start - 1 for part in self.parts) * self.dt

    def trajectory(self, part: slice) -> Trajectory:
        """One part, as `cmg_mj.replay.replay` takes it."""
        return Trajectory({name: values[part] for name, values in self.columns.items()})

    def scored(self, skip_s: float) -> np.ndarray:
        """Which samples count: those from so long after the start of a part, (n,)."""
        counted = np.zeros(len(self), dtype=bool)
        for part in self.parts:
            counted[part.start + math.ceil(skip_s / self.dt - 1e-9) : part.stop] = True
        return counted

    def broken(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Times and values with a NaN between two parts, so that no line is drawn across a gap."""
        time = [np.append(self["time_s"][part], self["time_s"][part][-1] + self.dt) for part in self.parts]
        drawn = [np.append(values[part], np.nan) for part in self.parts]
        return np.concatenate(time)[:-1], np.concatenate(drawn)[:-1]

    def cut(self, rows: slice) -> Log:
        """A piece of it."""
        start, stop, _ = rows.indices(len(self))
        parts = [slice(max(p.start, start) - start, min(p.stop, stop) - start) for p in self.parts]
        columns = {name: values[start:stop] for name, values in self.columns.items()}
        return replace(self, columns=columns, parts=[part for part in parts if part.stop - part.start > 1])


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
        log = _of_trajectory(path)
        told = {"--units": units, "--scale": scale, "--offset": offset, "--rate": rate_hz, "--max-gap": max_gap_s}
        told |= {"--delay": delay_s, "--radii": radii_m, "--between": between_s}
        for option, value in told.items():
            if value not in (None, 0.0, {}):
                raise InputError(f"{option}: {path} is a run's own recording; read it with --columns for that")
        return log if not windows_s else replace(log, windows=_inside(path, windows_s, log["time_s"]))
    found = columns_of(columns, units, scale, offset)
    tilt = _radial(found, radii_m)
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
    _check_sizes(path, found, raw)
    time = raw.pop("time", None)
    if time is not None and not found["time"].told:
        _check_assumed(path, found["time"].name, time)
        notes.append(f"the time {found['time'].name!r} is taken as seconds")
    reference = raw.pop("rate", None)
    if between_s is not None:
        time, raw, reference = _between(path, time, raw, reference, between_s, rate_hz)
    measured = _measured(raw, tilt, notes)
    sampler = Sampler(str(path), rate_hz, max_gap_s, notes)
    dt, parts = sampler.parts(time, measured, held=("u_rad_s",))
    stamps = np.arange(len(measured["y1_rad"])) / (rate_hz or 1.0) if time is None else time
    joined = _joined(parts, stamps, reference, delay_s)
    _check_motion(path, joined, reference is not None)
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
    windows = _inside(path, windows_s, joined["time_s"])
    slices = [slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
    return Log(path.stem, dt, joined, slices, frozenset(has), tilt, windows, tuple(notes), given)


def _inside(path: Path, windows: Sequence[Window], time: np.ndarray) -> tuple[Window, ...]:
    """The windows, in each of which there is a sample."""
    for start, end in windows:
        if not inside(time, [(start, end)]).any():
            ends = f"{time[0]:.6g} to {time[-1]:.6g} s"
            raise InputError(f"--window {start:g}:{end:g}: {path} has no sample there; it goes from {ends}")
    return tuple(windows)


def _radial(found: Mapping[str, Column], radii: tuple[float, float] | None) -> RadialTilt | None:
    """Where the accelerometers are."""
    if "inner_x" not in found:
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
        found["y1_rad"] = _turned(np.asarray(tilt(*forces)), notes)
        found["acceleration_rad_s2"] = np.asarray(tilt.acceleration(raw["inner_x"], raw["outer_x"]))
    else:
        found["y1_rad"] = _turned(raw["tilt"], notes)
        if "acceleration" in raw:
            found["acceleration_rad_s2"] = raw["acceleration"]
    if "gimbal" in raw:
        found["y2_rad"] = raw["gimbal"]
    elif "gimbal1" in raw:
        found["y2_rad"] = (raw["gimbal1"] - raw["gimbal2"]) / 2.0
    if "command" in raw:
        found["u_rad_s"] = raw["command"]
    return found


def _turned(angle: np.ndarray, notes: list[str]) -> np.ndarray:
    """An angle that starts again after a turn, made to run on. A row that leaps out and back is no turn: it stays."""
    known = np.flatnonzero(np.isfinite(angle))
    spikes = _spikes(angle[known])
    if len(spikes):
        rows = f"row {known[spikes[0]] + 1}"
        where = f"in {rows} alone" if len(spikes) == 1 else f"in {len(spikes):,} single rows, first {rows}"
        size = math.degrees(angle[known[spikes[0]]] - angle[known[spikes[0] - 1]])
        notes.append(f"the tilt leaps by {size:.4g} deg and back {where}: a spike, kept as it is")
    smooth = np.delete(known, spikes)
    jumps = int((np.abs(np.diff(angle[smooth])) > A_TURN).sum())
    if not jumps:
        return angle
    notes.append(f"the tilt jumps by a turn {jumps:,} time{'' if jumps == 1 else 's'}: made to run on")
    out = angle.copy()
    out[smooth] = np.unwrap(angle[smooth])
    before = known[spikes - 1]
    out[known[spikes]] += out[before] - angle[before]
    return out


def _spikes(angle: np.ndarray) -> np.ndarray:
    """Places of single values that leap out and back and are no angle near the end of a turn that flickers."""
    steps = np.diff(angle)
    out, back = steps[:-1], steps[1:]
    leaps = (np.abs(out) > A_TURN) & (np.abs(back) > A_TURN) & (out * back < 0.0)
    if not leaps.any():
        return np.flatnonzero(leaps)
    # Angles that start again lie within one turn: what leaps out of that, or by less than a turn, has not.
    others, middle = np.delete(angle, np.flatnonzero(leaps) + 1), angle[1:-1]
    reach = np.maximum(middle, others.max()) - np.minimum(middle, others.min())
    short = np.abs(np.abs(out) - 2.0 * math.pi) > 5.0 * np.median(np.abs(steps)) + A_FLICKER
    flickers = (reach < 2.0 * math.pi + 1e-6) & ~short
    return np.flatnonzero(leaps & ~flickers) + 1


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


def _check_sizes(path: Path, found: Mapping[str, Column], raw: Mapping[str, np.ndarray]) -> None:
    """Refuse numbers so large that formulas overflow; nothing measured has them."""
    for role, values in raw.items():
        beyond = np.abs(values) > LARGEST
        if beyond.any():
            row = int(np.argmax(beyond))
            where = f"{path}: row {row + 1}, column {found[role].name!r}"
            raise InputError(f"{where}: {values[row]:.3g} in SI units is no {role}; at most {LARGEST:g}")


def _check_assumed(path: Path, name: str, time: np.ndarray) -> None:
    """Refuse times whose unit nobody says and that would be slow in seconds: milliseconds of a quick log are."""
    steps = np.abs(np.diff(time[np.isfinite(time)]))
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual * SLOW_HZ > 1.0:
        raise InputError(
            f"{path}: in seconds the rows of {name!r} would be {usual:.4g} s apart, {1.0 / usual:.3g} Hz, and no unit "
            "is said: --units time=ms, or time=s if that is right"
        )


def _check_motion(path: Path, columns: Mapping[str, np.ndarray], referred: bool) -> None:
    """Refuse what nothing can be learnt from."""
    tilt, reference = columns["y1_rad"], columns[REFERENCE]
    if np.ptp(tilt) == 0.0:
        raise InputError(f"{path}: the tilt is {tilt[0]:g} rad in every row: nothing moves")
    known = reference[np.isfinite(reference)]
    if referred and not len(known):
        raise InputError(f"{path}: the reference has no number where the tilt has one")
    if referred and np.ptp(known) == 0.0:
        raise InputError(f"{path}: the reference is {known[0]:g} rad/s in every row: leave it out")


def _say_halves(found: Mapping[str, Column], has: set[str], notes: list[str]) -> None:
    """What is named, but not enough to be used."""
    gimbal = "gimbal" in found or "gimbal1" in found
    if gimbal != ("command" in found):
        there, lacks = ("gimbal", "command") if gimbal else ("command", "gimbal")
        notes.append(f"there is a {there} and no {lacks}: observers that need the gimbals need both")


def _of_trajectory(path: Path) -> Log:
    """A run's own recording, whose columns are known."""
    if not path.is_file() or _begins(path) != b"PAR1":
        if not path.exists():
            raise InputError(f"{path}: no such file; name a CSV or Parquet file, or the folder of a run")
        raise InputError(f"{path}: {SAY_COLUMNS}")
    try:
        trajectory = Trajectory.load(path)
    except InputError as error:
        if "not a trajectory written by" in str(error):
            raise InputError(f"{path}: {SAY_COLUMNS}") from error
        raise
    scenario = trajectory.metadata.get("scenario")
    if scenario is None:  # signals.parquet of a replay
        raise InputError(f"{path}: {SAY_COLUMNS}")
    try:
        rate = float(scenario["controller"]["rate_hz"])
        pushes = [Push(**push) for push in scenario.get("push", ())]
        columns = {name: trajectory[name] for name in ("time_s", "y1_rad", "y2_rad", "u_rad_s", "acceleration_rad_s2")}
        columns[REFERENCE] = trajectory["x2_rad_s"]
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: a trajectory, but of an earlier version of cmg-mj; run its scenario again"
        ) from error
    if len(trajectory) < 2:
        raise InputError(f"{path}: a run that ended before its second tick")
    has = frozenset({"gimbals", "acceleration", "reference"})
    name = path.parent.name if path.stem == "trajectory" and path.parent.name else path.stem
    everything = [slice(0, len(trajectory))]
    return Log(name, 1.0 / rate, columns, everything, has, None, push_windows(pushes), (), {}, scenario)


def _begins(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(4)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
