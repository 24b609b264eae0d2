"""What a run leaves behind, tick by tick; saved and loaded as Parquet."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cmg_mj.errors import InputError

SIGNALS = (
    "x1_rad",
    "x2_rad_s",
    "x3_rad",
    "y1_rad",
    "y2_rad",
    "fog_rad_s",
    "u_rad_s",
    "x_e_rad_times_s",
    "push_n_m",
)
"""Columns of every trajectory after `time_s`: true state, measurements, gyro, command, integrator [rad s], push."""

ESTIMATES = ("x1_rad", "x2_rad_s", "x3_rad")
"""Columns of every observer, under `estimate/<observer>/`; what it estimates beyond x comes after them."""


def column_names(observers: Sequence[str], extras: Sequence[Sequence[str]], joints: Sequence[str]) -> list[str]:
    """Names of a trajectory's columns after `time_s`, in order."""
    return [
        *SIGNALS,
        *(
            f"estimate/{observer}/{name}"
            for observer, more in zip(observers, extras, strict=True)
            for name in (*ESTIMATES, *more)
        ),
        *(f"angle/{joint}_rad" for joint in joints),
        *(f"rate/{joint}_rad_s" for joint in joints),
    ]


@dataclass(frozen=True)
class Trajectory:
    """One row a control tick.

    Attributes:
        columns: Name -> values, (n_ticks,) for one world, (n_ticks, n_worlds) for many; the unit ends the name.
            In many worlds, rows after a world's end are NaN.
        metadata: The observer, its companions, the outcome and the resolved scenario.
    """

    columns: dict[str, np.ndarray]
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    @property
    def observers(self) -> list[str]:
        """Names of the observers whose estimates are recorded: the one in the loop, then the companions."""
        return [
            name.split("/")[1] for name in self.columns if name.startswith("estimate/") and name.endswith("/x2_rad_s")
        ]

    def extra_signals(self, observer: str) -> list[str]:
        """Names of what an observer estimates beyond x."""
        names = [name.split("/")[2] for name in self.columns if name.startswith(f"estimate/{observer}/")]
        return [name for name in names if name not in ESTIMATES]

    @property
    def joints(self) -> list[str]:
        """Names of the rig's joints, in the order of qpos."""
        return [name[len("angle/") : -len("_rad")] for name in self.columns if name.startswith("angle/")]

    def qpos(self) -> np.ndarray:
        """Joint angles, (n_ticks, n_joints) [rad]."""
        return np.stack([self.columns[f"angle/{joint}_rad"] for joint in self.joints], axis=-1)

    def world(self, index: int) -> Trajectory:
        """One world of many, up to its end."""
        columns = {name: values if name == "time_s" else values[:, index] for name, values in self.columns.items()}
        kept = np.isfinite(columns["x1_rad"])
        return Trajectory({name: values[kept] for name, values in columns.items()}, self.metadata)

    def of_worlds(self, worlds: np.ndarray | slice) -> Trajectory:
        """Some of many worlds: their indices, a mask (n_worlds,) or a slice."""
        columns = {name: values if name == "time_s" else values[:, worlds] for name, values in self.columns.items()}
        return Trajectory(columns, self.metadata)

    def between(self, start_s: float, end_s: float) -> Trajectory:
        """The rows from one time to another, both included."""
        kept = (self["time_s"] >= start_s - 1e-9) & (self["time_s"] <= end_s + 1e-9)
        return Trajectory({name: values[kept] for name, values in self.columns.items()}, self.metadata)

    def save(self, path: Path) -> None:
        """Write one world's trajectory as Parquet, whole or not at all."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        metadata = {b"cmg_mj": json.dumps(self.metadata).encode()}
        table = pa.table(self.columns).replace_schema_metadata(metadata)
        with whole_file(path) as temporary:
            pq.write_table(table, temporary)

    @staticmethod
    def load(path: Path) -> Trajectory:
        """Read what `save` wrote.

        Args:
            path: The Parquet file.

        Returns:
            The trajectory.

        Raises:
            InputError: The file does not exist or is no trajectory.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            table = pq.read_table(path)
        except (OSError, pa.ArrowException) as error:
            raise InputError(f"{path}: not a trajectory: {' '.join(str(error).split())}") from error
        stored = (table.schema.metadata or {}).get(b"cmg_mj")
        if stored is None or "time_s" not in table.column_names:
            raise InputError(f"{path}: a Parquet file, but not a trajectory written by cmg-mj")
        return Trajectory({name: table[name].to_numpy() for name in table.column_names}, json.loads(stored))


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary name to write to; rename it to `path` at the end, or remove it if the writing failed."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()
