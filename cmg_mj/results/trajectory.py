"""What a run leaves behind, tick by tick; saved and loaded as Parquet."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cmg_mj.errors import InputError, nearest
from cmg_mj.results.files import write_parquet

SIGNALS = (
    "x1_rad",
    "x2_rad_s",
    "x3_rad",
    "y1_rad",
    "y2_rad",
    "acceleration_rad_s2",
    "fog_rad_s",
    "u_rad_s",
    "x_e_rad_times_s",
    "push_n_m",
)
"""Columns of every trajectory after `time_s`: true state, measurements, gyro, command, integrator [rad s], push."""

ESTIMATES = ("x1_rad", "x2_rad_s", "x3_rad")
"""What every observer estimates; what it estimates beyond x comes after them."""


POSITIONS = {
    "hinge": ("angle/{}_rad",),
    "slide": ("position/{}_m",),
    "ball": tuple(f"orientation/{{}}/{part}" for part in "wxyz"),
}
POSITIONS["free"] = (*(f"position/{{}}/{part}_m" for part in "xyz"), *POSITIONS["ball"])
"""Columns of a joint by its kind, in the order of MuJoCo's qpos: those of a free joint in the world's axes."""
RATES = {
    "hinge": ("rate/{}_rad_s",),
    "slide": ("velocity/{}_m_s",),
    "ball": tuple(f"rate/{{}}/{part}_rad_s" for part in "xyz"),
}
RATES["free"] = (*(f"velocity/{{}}/{part}_m_s" for part in "xyz"), *RATES["ball"])
"""The same of qvel: angular velocities in the body's own axes."""


@dataclass(frozen=True)
class Layout:
    """Whose columns a trajectory has, in their order.

    Attributes:
        observers: The observer in the loop, then the open-loop observers: columns `estimate/<observer>/<signal>`.
        extra_signals: For each of them the names of what it estimates beyond x.
        joints: In the order of qpos; a hinge has the columns `angle/<joint>_rad` and `rate/<joint>_rad_s`.
        kinds: Of each joint `hinge`, `slide`, `ball` or `free`: see `POSITIONS` and `RATES`; none if all are hinges.
        axes: Of a rig of several axes a layout each, without joints: the columns of an axis begin with `<axis>/`.
        name: Of the axis.
    """

    observers: tuple[str, ...] = ()
    extra_signals: tuple[tuple[str, ...], ...] = ()
    joints: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    axes: tuple[Layout, ...] = ()
    name: str = ""

    def positions(self) -> list[str]:
        """Names of the columns that make up qpos, in order."""
        return self._of_joints(POSITIONS)

    def rates(self) -> list[str]:
        """Names of the columns that make up qvel, in order."""
        return self._of_joints(RATES)

    def _of_joints(self, named: Mapping[str, Sequence[str]]) -> list[str]:
        kinds = self.kinds or ("hinge",) * len(self.joints)
        pairs = zip(self.joints, kinds, strict=True)
        return [name.format(joint) for joint, kind in pairs for name in named[kind]]

    def columns(self) -> list[str]:
        """Names of all columns after `time_s`, in order."""
        return [*self._signals(), *self.positions(), *self.rates()]

    def _signals(self) -> list[str]:
        """Those that are no joints'."""
        if self.axes:
            return [f"{own.name}/{column}" for own in self.axes for column in own._signals()]
        estimates = [
            f"estimate/{observer}/{name}"
            for observer, more in zip(self.observers, self.extra_signals, strict=True)
            for name in (*ESTIMATES, *more)
        ]
        return [*SIGNALS, *estimates]

    @staticmethod
    def loaded(kept: Mapping[str, Any]) -> Layout:
        """What `asdict` made of one, and JSON of that."""
        return Layout(
            tuple(kept["observers"]),
            tuple(map(tuple, kept["extra_signals"])),
            tuple(kept["joints"]),
            tuple(kept.get("kinds", ())),
            tuple(map(Layout.loaded, kept.get("axes", ()))),
            kept.get("name", ""),
        )


@dataclass(frozen=True)
class Trajectory:
    """One row a control tick.

    Attributes:
        columns: Name -> values, (n_ticks,) for one world, (n_ticks, n_worlds) for many; the unit ends the name.
            In many worlds, rows after a world's end are NaN.
        metadata: The outcome and the resolved scenario.
        layout: Whose columns they are; empty for one put together by hand.
    """

    columns: dict[str, np.ndarray]
    metadata: Mapping[str, Any] = field(default_factory=dict)
    layout: Layout = field(default_factory=Layout)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    @property
    def observers(self) -> tuple[str, ...]:
        """Names of the observers whose estimates are recorded: the one in the loop, then the open-loop observers."""
        return self.layout.observers

    def extra_signals(self, observer: str) -> tuple[str, ...]:
        """Names of what an observer estimates beyond x."""
        return self.layout.extra_signals[self.layout.observers.index(observer)]

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the rig's joints, in the order of qpos."""
        return self.layout.joints

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the rig's axes, if it has several."""
        return tuple(own.name for own in self.layout.axes)

    def along(self, axis: str) -> Trajectory:
        """One axis of several, with the columns that a rig of one axis has.

        Args:
            axis: Its name.

        Returns:
            Its trajectory, with all joints.

        Raises:
            InputError: There is no such axis.
        """
        if axis not in self.axes:
            raise InputError(f"axis {axis!r}: {nearest(axis, self.axes)}")
        own = replace(
            self.layout.axes[self.axes.index(axis)], joints=self.layout.joints, kinds=self.layout.kinds, name=""
        )
        columns = {"time_s": self["time_s"]}
        for name in own.columns():
            columns[name] = self.columns[name if name in self.columns else f"{axis}/{name}"]
        return replace(self, columns=columns, layout=own)

    @staticmethod
    def joined(axes: Mapping[str, Trajectory]) -> Trajectory:
        """The trajectories of a rig's axes as one; the first has the joints."""
        first = next(iter(axes.values()))
        parts = tuple(replace(own.layout, joints=(), kinds=(), name=name) for name, own in axes.items())
        layout = replace(first.layout, axes=parts)
        columns = {"time_s": first["time_s"]}
        for part, own in zip(parts, axes.values(), strict=True):
            columns |= {f"{part.name}/{name}": own[name] for name in part.columns()}
        joints = (*layout.positions(), *layout.rates())
        return Trajectory(columns | {name: first[name] for name in joints}, layout=layout)

    def qpos(self) -> np.ndarray:
        """Joint positions as MuJoCo has them, (n_ticks, nq) [rad, m, quaternions w, x, y, z]."""
        return np.stack([self.columns[name] for name in self.layout.positions()], axis=-1)

    def world(self, index: int) -> Trajectory:
        """One world of many, up to its end."""
        columns = {name: values if name == "time_s" else values[:, index] for name, values in self.columns.items()}
        kept = np.isfinite(columns[self.layout.columns()[0] if self.layout.axes else SIGNALS[0]])
        return replace(self, columns={name: values[kept] for name, values in columns.items()})

    def of_worlds(self, worlds: np.ndarray | slice) -> Trajectory:
        """Some of many worlds: their indices, a mask (n_worlds,) or a slice."""
        columns = {name: values if name == "time_s" else values[:, worlds] for name, values in self.columns.items()}
        return replace(self, columns=columns)

    def from_tick(self, tick: int) -> Trajectory:
        """The rows from one on."""
        return replace(self, columns={name: values[tick:] for name, values in self.columns.items()})

    def between(self, start_s: float, end_s: float) -> Trajectory:
        """The rows from one time to another, both included."""
        kept = (self["time_s"] >= start_s - 1e-9) & (self["time_s"] <= end_s + 1e-9)
        return replace(self, columns={name: values[kept] for name, values in self.columns.items()})

    def save(self, path: Path) -> None:
        """Write one world's trajectory as Parquet, whole or not at all."""
        import pyarrow as pa

        stored = {"layout": asdict(self.layout), **self.metadata}
        metadata = {b"cmg_mj": json.dumps(stored).encode()}
        write_parquet(path, pa.table(self.columns).replace_schema_metadata(metadata))

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
        text = (table.schema.metadata or {}).get(b"cmg_mj")
        if text is None or "time_s" not in table.column_names:
            raise InputError(f"{path}: a Parquet file, but not a trajectory written by cmg-mj")
        try:
            stored = json.loads(text)
            layout = Layout.loaded(stored.pop("layout"))
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            raise InputError(
                f"{path}: a trajectory, but of an earlier version of cmg-mj; run its scenario.toml again"
            ) from error
        return Trajectory({name: table[name].to_numpy() for name in table.column_names}, stored, layout)
