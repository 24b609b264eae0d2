"""A log: what was measured, evenly sampled, in the names and units of a trajectory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cmg_mj.core.tilt import RadialTilt
from cmg_mj.errors import TomlValue
from cmg_mj.replay.logs.white_noise import LogNoise
from cmg_mj.results.stored_columns import number_of_rows, select_rows
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.stages.push import Window

REFERENCE = "reference_rad_s"
"""The column of the rate that estimates are judged against; NaN where it is not known."""


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
        return number_of_rows(self.columns)

    @property
    def duration_s(self) -> float:
        """Duration without the gaps [s]."""
        return sum(part.stop - part.start - 1 for part in self.parts) * self.dt

    def trajectory(self, part: slice) -> Trajectory:
        """Return one part, as `cmg_mj.replay.replay` takes it."""
        return Trajectory(select_rows(self.columns, part))

    def scored(self, settle_s: float) -> np.ndarray:
        """Return which samples count: those from `settle_s` after the start of a part on, (n,)."""
        counted = np.zeros(len(self), dtype=bool)
        for part in self.parts:
            counted[part.start + math.ceil(min(settle_s / self.dt, len(self)) - 1e-9) : part.stop] = True
        return counted

    def broken(self, values: np.ndarray, rows: slice = slice(None)) -> tuple[np.ndarray, np.ndarray]:
        """Return times and values with a NaN between two parts, so that no line is drawn across a gap.

        Args:
            values: The values in some rows, (n,).
            rows: These rows.

        Returns:
            Times [s] and values.
        """
        start, stop, _ = rows.indices(len(self))
        clock = select_rows(self.columns, slice(start, stop))["time_s"]
        time, drawn = [], []
        for part in self.parts:
            some = slice(max(part.start, start) - start, min(part.stop, stop) - start)
            if some.start < some.stop:
                time.append(clock[some])
                drawn.append(values[some])
                if start + some.stop == part.stop < self.parts[-1].stop:
                    time.append(clock[some][-1:] + self.dt)
                    drawn.append(np.array([np.nan]))
        return np.concatenate(time), np.concatenate(drawn)

    def cut(self, rows: slice) -> Log:
        """Return the log's part in a range of rows."""
        start, stop, _ = rows.indices(len(self))
        parts = [slice(max(p.start, start) - start, min(p.stop, stop) - start) for p in self.parts]
        columns = select_rows(self.columns, slice(start, stop))
        return replace(self, columns=columns, parts=[part for part in parts if part.stop - part.start > 1])
