"""A log: what was measured, evenly sampled, in the names and units of a trajectory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, TomlValue
from cmg_mj.core.tilt import RadialTilt
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.stages.push import Push, Window, push_windows

REFERENCE = "reference_rad_s"
"""The column of the rate that estimates are judged against; NaN where it is not known."""


class WhiteNoise(NamedTuple):
    """Standard deviation of the white noise of one row, with its 95 % interval."""

    sigma: float
    low: float
    high: float


class LogNoise(NamedTuple):
    """White noise of one row of a file, or why it cannot be told."""

    tilt: WhiteNoise | str
    """Noise of the tilt [rad]."""
    acceleration: WhiteNoise | str | None
    """Noise of the angular acceleration [rad/s^2]; None without one."""
    correlation: float
    """Correlation of both; 0 where it cannot be told from 0."""


@dataclass(frozen=True)
class ReadOptions:
    """Options with which a log is read; the command line has one option for each.

    Attributes:
        columns: Role -> heading, such as `{"tilt": "pitch_deg", "rate": "gyro_dps"}`; the roles: `ROLES`. Empty for a
            run's own recording.
        units: Role -> unit, for headings that do not end in theirs.
        scale: Role -> factor.
        offset: Role -> addend after the scale, in the column's unit.
        rate_hz: Rate of rows without a time; rows with a time are resampled to this rate [Hz].
        max_gap_s: Longer gaps part the log; by default those of more than five rows [s].
        delay_s: Lag of the reference behind the other signals [s].
        radii_m: Distances of two accelerometers from the pivot, the inner first [m].
        time_range_s: Start and end of the part to read, from the first row on [s].
        windows_s: Windows that are scored separately, in the log's own time [s].
        delimiter: Character between the cells of a CSV.
        encoding: Encoding of a CSV.
        decimal: Decimal point of the numbers in a CSV.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    offset: Mapping[str, float] = field(default_factory=dict)
    rate_hz: float | None = None
    max_gap_s: float | None = None
    delay_s: float = 0.0
    radii_m: tuple[float, float] | None = None
    time_range_s: tuple[float, float] | None = None
    windows_s: Sequence[Window] = ()
    delimiter: str = ","
    encoding: str = "utf-8"
    decimal: str = "."

    def as_toml(self) -> dict[str, TomlValue]:
        """Return the options that are not the defaults, as TOML holds them."""
        defaults, options = vars(ReadOptions()), {**vars(self), "windows_s": tuple(self.windows_s)}
        return {name: value for name, value in options.items() if value != defaults[name]}


@dataclass(frozen=True)
class Log:
    """One log.

    Attributes:
        name: Name of the file, without its ending.
        dt: Sample period [s].
        columns: `time_s`, `y1_rad`, `y2_rad`, `u_rad_s`, `acceleration_rad_s2`, `reference_rad_s`, each (n,). Where
            the log lacks a signal, y2 and u are zero, the others NaN.
        parts: Slices without a gap; the observers start at the beginning of each.
        has: Signals of the log among "gimbals" (y2 and u), "acceleration" and "reference".
        tilt: Geometry of the two accelerometers, if they measure the tilt.
        windows: Windows that are scored separately [s].
        notes: Changes to the rows that were not requested, and likely mistakes, a line each.
        options: Options with which it was read, the units of all columns among them.
        scenario: The resolved scenario of a run's recording.
        row_period_s: Period of the file's own rows, whatever the sample period [s]; None for a run's recording.
        white_noise: White noise of one of these rows; None for a run's recording.
    """

    name: str
    dt: float
    columns: Mapping[str, np.ndarray]
    parts: Sequence[slice]
    has: frozenset[str]
    tilt: RadialTilt | None = None
    windows: Sequence[Window] = ()
    notes: Sequence[str] = ()
    options: ReadOptions = ReadOptions()
    scenario: Mapping[str, Any] | None = None
    row_period_s: float | None = None
    white_noise: LogNoise | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self["time_s"])

    @property
    def duration_s(self) -> float:
        """Duration without the gaps [s]."""
        return sum(part.stop - part.start - 1 for part in self.parts) * self.dt

    @property
    def title(self) -> str:
        """The log in one line."""
        parts = "" if len(self.parts) == 1 else f" in {len(self.parts)} parts"
        return f"{self.name}: {len(self):,} samples at {1.0 / self.dt:.6g} Hz, {self.duration_s:.6g} s{parts}"

    def trajectory(self, part: slice) -> Trajectory:
        """Return one part, as `cmg_mj.features.replay.log_replay` takes it."""
        return Trajectory({name: values[part] for name, values in self.columns.items()})

    def scored(self, settle_s: float) -> np.ndarray:
        """Return which samples count: those from `settle_s` after the start of a part on, (n,)."""
        counted = np.zeros(len(self), dtype=bool)
        for part in self.parts:
            counted[part.start + math.ceil(min(settle_s / self.dt, len(self)) - 1e-9) : part.stop] = True
        return counted

    def broken(self, values: np.ndarray) -> np.ndarray:
        """Put a NaN between two parts of values, (n,): no line is drawn across a gap."""
        first, *others = self.parts
        pieces = [piece for part in others for piece in ([np.nan], values[part])]
        return np.concatenate([values[first], *pieces]) if others else values[first]

    def broken_time(self) -> np.ndarray:
        """Return the times of `broken` values [s]."""
        time = self.broken(self["time_s"])
        return np.where(np.isnan(time), np.roll(time, 1) + self.dt, time)

    def cut(self, rows: slice) -> Log:
        """Return the log's part in a range of rows."""
        start, stop, _ = rows.indices(len(self))
        parts = [slice(max(p.start, start) - start, min(p.stop, stop) - start) for p in self.parts]
        columns = {name: values[start:stop] for name, values in self.columns.items()}
        return replace(self, columns=columns, parts=[part for part in parts if part.stop - part.start > 1])


def log_of_run(path: Path) -> Log:
    """Read a run's own recording, whose columns, pushes and scenario are known.

    Raises:
        InputError: The file is no recording of a run about one axis.
    """
    try:
        trajectory = Trajectory.load(path)
        scenario = trajectory.metadata["scenario"]
    except (InputError, LookupError) as error:
        raise InputError(f"{path}: say which columns are what, --columns tilt=HEADING,rate=HEADING,...") from error
    if trajectory.axes:
        raise InputError(
            f"{path}: a run about several axes ({', '.join(trajectory.axes)}), and replay takes one; save one of them "
            f"from Python: Trajectory.load(path).along({trajectory.axes[0]!r}).save(...)"
        )
    if len(trajectory) < 2:
        raise InputError(f"{path}: a run that ended before its second tick")
    columns = {name: trajectory[name] for name in ("time_s", "y1_rad", "y2_rad", "u_rad_s", "acceleration_rad_s2")}
    columns[REFERENCE] = trajectory["x2_rad_s"]
    return Log(
        path.parent.name if path.stem == "trajectory" and path.parent.name else path.stem,
        1.0 / float(scenario["controller"]["rate_hz"]),
        columns,
        [slice(0, len(trajectory))],
        frozenset({"gimbals", "acceleration", "reference"}),
        windows=push_windows([Push(**push) for push in scenario.get("push", ())]),
        scenario=scenario,
    )
