"""A log: what was measured, evenly sampled, in the names and units of a trajectory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.disturbances import Window
from cmg_mj.sensors.tilt import RadialTilt

REFERENCE = "reference_rad_s"
"""The column of the rate that estimates are judged against; NaN where it is not known."""


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
        notes: What was done to the rows that nobody has asked for, and what seems mistaken, a line each.
        given: From what it was read, for a file to tell.
        scenario: Of a trajectory the scenario, resolved.
        rows_s: Between the file's own rows, whatever the samples' period [s]; None of a trajectory.
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
    rows_s: float | None = None

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
