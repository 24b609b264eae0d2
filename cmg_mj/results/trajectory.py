"""A run tick by tick, saved and loaded as Parquet."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.core.types import STATE_SIGNALS
from cmg_mj.results.folder import METADATA_KEY, write_parquet

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

SIGNALS = (
    *STATE_SIGNALS,
    "y1_rad",
    "y2_rad",
    "acceleration_rad_s2",
    "fog_rad_s",
    "u_rad_s",
    "x_e_rad_times_s",
    "push_n_m",
)
"""Columns of every trajectory after `time_s`: true state, measurements, gyro, command, integrator [rad s], push."""

GYRO = "mems_gyro_rad_s"
"""Column of the cheap gyro's reading, where an observer needs it."""

POSITIONS = {
    "hinge": ("angle/{}_rad",),
    "slide": ("position/{}_m",),
    "ball": tuple(f"orientation/{{}}/{part}" for part in "wxyz"),
}
POSITIONS["free"] = (*(f"position/{{}}/{part}_m" for part in "xyz"), *POSITIONS["ball"])
"""Columns of a joint by its kind, in the order of MuJoCo's qpos; a free joint's are in the world's axes."""
RATES = {
    "hinge": ("rate/{}_rad_s",),
    "slide": ("velocity/{}_m_s",),
    "ball": tuple(f"rate/{{}}/{part}_rad_s" for part in "xyz"),
}
RATES["free"] = (*(f"velocity/{{}}/{part}_m_s" for part in "xyz"), *RATES["ball"])
"""Columns of a joint by its kind, in the order of qvel; angular velocities are in the body's own axes."""


@dataclass(frozen=True)
class Layout:
    """The observers, joints and axes that a trajectory has columns of.

    Attributes:
        observers: The observer in the loop, then the open-loop observers: columns `estimate/<observer>/<signal>`.
        extra_signals: For each observer the names of the signals that it estimates beyond x.
        joints: In the order of qpos; a hinge has the columns `angle/<joint>_rad` and `rate/<joint>_rad_s`.
        kinds: `hinge`, `slide`, `ball` or `free` for each joint (see `POSITIONS` and `RATES`); none if all are hinges.
        gyro: True if the cheap gyro was read: column `mems_gyro_rad_s`.
        axes: For a plant of several axes a layout each, without joints: the columns of an axis begin with `<axis>/`.
        name: The axis' name.
    """

    observers: tuple[str, ...]
    extra_signals: tuple[tuple[str, ...], ...]
    joints: tuple[str, ...]
    kinds: tuple[str, ...] = ()
    gyro: bool = False
    axes: tuple[Layout, ...] = ()
    name: str = ""

    def positions(self) -> list[str]:
        """List the columns that make up qpos, in order."""
        return self._joint_columns(POSITIONS)

    def rates(self) -> list[str]:
        """List the columns that make up qvel, in order."""
        return self._joint_columns(RATES)

    def _joint_columns(self, patterns: Mapping[str, Sequence[str]]) -> list[str]:
        kinds = self.kinds or ("hinge",) * len(self.joints)
        pairs = zip(self.joints, kinds, strict=True)
        return [pattern.format(joint) for joint, kind in pairs for pattern in patterns[kind]]

    def columns(self) -> list[str]:
        """List all columns after `time_s`, in order."""
        return [*self._signals(), *self.positions(), *self.rates()]

    def _signals(self) -> list[str]:
        """List the columns that are no joints'."""
        if self.axes:
            return [f"{axis.name}/{column}" for axis in self.axes for column in axis._signals()]
        estimates = [
            f"estimate/{observer}/{name}"
            for observer, more in zip(self.observers, self.extra_signals, strict=True)
            for name in (*STATE_SIGNALS, *more)
        ]
        return [*SIGNALS, *([GYRO] if self.gyro else []), *estimates]


def frame_of(table: pa.Table) -> pd.DataFrame:
    """Convert a table to a pandas frame.

    Raises:
        InputError: pandas is not installed.
    """
    try:
        return table.to_pandas()
    except ImportError as error:
        raise InputError(
            "to_pandas: pandas is not installed. Install it with `python -m pip install pandas`, or use the columns "
            "without it: dict(...) has them as NumPy arrays"
        ) from error


class NamedColumns:
    """Columns by name, with the conventions of a pandas frame: iteration gives names, `len` counts rows."""

    columns: Any
    """Name -> column, in order."""

    def keys(self) -> list[str]:
        """List the columns' names, in order; with it `dict(...)` takes all columns."""
        return list(self)

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


@dataclass(frozen=True)
class Trajectory(NamedColumns):
    """One row a control tick, by column: `trajectory["x1_rad"]`.

    As with a pandas frame, iteration and `keys()` give the columns' names and `len` counts the rows.
    `dict(trajectory)` has all columns as arrays.

    Attributes:
        columns: Name -> values, (n_ticks,) for one world, (n_ticks, n_worlds) for many; the unit ends the name.
            In many worlds, rows after a world's end are NaN.
        metadata: The outcome and the resolved scenario.
        layout: The observers, joints and axes that have columns; empty for a trajectory put together by hand.
    """

    columns: Mapping[str, np.ndarray]
    metadata: Mapping[str, Any] = field(default_factory=dict)
    layout: Layout = Layout((), (), ())

    @property
    def observers(self) -> tuple[str, ...]:
        """Names of the observers whose estimates are recorded: the one in the loop, then the open-loop observers."""
        return self.layout.observers

    def extra_signals(self, observer: str) -> tuple[str, ...]:
        """List the signals that an observer estimates beyond x."""
        return self.layout.extra_signals[self.layout.observers.index(observer)]

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the plant's joints, in the order of qpos."""
        return self.layout.joints

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the plant's axes, if it has several."""
        return tuple(axis.name for axis in self.layout.axes)

    def along(self, axis: str) -> Trajectory:
        """Select one axis of several, with the columns that a plant of one axis has.

        Args:
            axis: The axis' name.

        Returns:
            The axis' trajectory, with all joints.

        Raises:
            InputError: There is no such axis.
        """
        if axis not in self.axes:
            raise InputError(f"axis {axis!r}: {nearest(axis, self.axes)}")
        part = self.layout.axes[self.axes.index(axis)]
        layout = replace(part, joints=self.layout.joints, kinds=self.layout.kinds, name="")
        known = {name.removeprefix(f"{axis}/"): values for name, values in self.columns.items()}
        return replace(self, columns={name: known[name] for name in ("time_s", *layout.columns())}, layout=layout)

    @staticmethod
    def joined(axes: Mapping[str, Trajectory]) -> Trajectory:
        """Join the trajectories of a plant's axes, the first of which has the joints; an only one stays as it is."""
        first = next(iter(axes.values()))
        if len(axes) == 1:
            return first
        parts = tuple(replace(axis.layout, joints=(), kinds=(), name=name) for name, axis in axes.items())
        layout = replace(first.layout, axes=parts)
        known = {f"{name}/{column}": axis[column] for name, axis in axes.items() for column in axis}
        known |= first.columns
        return Trajectory({name: known[name] for name in ("time_s", *layout.columns())}, layout=layout)

    def qpos(self, ticks: slice | np.ndarray = slice(None)) -> np.ndarray:
        """Stack the joint positions as MuJoCo has them, (n_ticks, nq) [rad, m, quaternions w, x, y, z]."""
        return np.stack([self.columns[name][ticks] for name in self.layout.positions()], axis=-1)

    def world(self, index: int) -> Trajectory:
        """Select one world of many, up to its end."""
        alone, first = self.of_worlds(index), self.keys()[1]
        return alone._rows(np.isfinite(alone[first]))  # NaN after the world's end

    def of_worlds(self, worlds: np.ndarray | slice | int) -> Trajectory:
        """Select some of many worlds by their indices, a mask (n_worlds,) or a slice."""
        columns = {name: values if name == "time_s" else values[:, worlds] for name, values in self.columns.items()}
        return replace(self, columns=columns)

    def between(self, start_s: float, end_s: float) -> Trajectory:
        """Select the rows from one time to another, both included."""
        return self._rows((self["time_s"] >= start_s - 1e-9) & (self["time_s"] <= end_s + 1e-9))

    def _rows(self, rows: np.ndarray) -> Trajectory:
        return replace(self, columns={name: values[rows] for name, values in self.columns.items()})

    def to_pandas(self) -> pd.DataFrame:
        """Make a pandas frame with a row a control tick.

        Returns:
            The columns of the trajectory, units in their names. Of many worlds, the rows of one world after the other,
            each up to its end, with the world's position in the batch as the column `world`.

        Raises:
            InputError: pandas is not installed.
        """
        import pyarrow as pa

        columns = self.columns
        *_, last = columns.values()
        if last.ndim == 2:
            worlds = [self.world(index) for index in range(last.shape[1])]
            number = np.repeat(np.arange(len(worlds)), [len(world) for world in worlds])
            columns = {"world": number, **{name: np.concatenate([world[name] for world in worlds]) for name in self}}
        return frame_of(pa.table(columns))

    def save(self, path: Path) -> None:
        """Write one world's trajectory as Parquet, whole or not at all."""
        import pyarrow as pa

        write_parquet(path, pa.table(dict(self.columns)), {"layout": asdict(self.layout), **self.metadata})

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
            with open(path, "rb") as file:
                table = pq.read_table(file)
        except (OSError, pa.ArrowException) as error:
            raise InputError(f"{path}: not a trajectory: {' '.join(str(error).split())}") from error
        try:
            stored = json.loads((table.schema.metadata or {})[METADATA_KEY])
            layout = TypeAdapter(Layout).validate_python(stored.pop("layout"))
            columns = {name: table[name].cast(pa.float64()).to_numpy() for name in table.column_names}
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError, pa.ArrowException) as error:
            raise InputError(
                f"{path}: a Parquet file, but no trajectory of this version of cmg-mj; run its scenario.toml again"
            ) from error
        return Trajectory(columns, stored, layout)
