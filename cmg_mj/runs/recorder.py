"""Ticks on their way to the metrics and, if kept, to the trajectory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.controller import Controller, Tick
from cmg_mj.plant.physics import Joints
from cmg_mj.plant.plant import Plant
from cmg_mj.results.baselines import Baselines
from cmg_mj.results.metrics import Metrics, TickBlock
from cmg_mj.results.trajectory import ESTIMATES, Layout, Trajectory

TICKS_A_PIECE = 256
"""Ticks that are made into columns together, which is much cheaper than one by one."""


class TickRecorder:
    """Collects the ticks of one or many worlds.

    Args:
        plants: The rigs, one a world.
        observers: Names of the observer in the loop, then of the open-loop observers.
        controller: The controller whose ticks they are: floats of one world, or arrays (n_worlds,).
        metrics: Takes every piece.
        references: The baselines that give a rate.
        keep: Whether to keep the pieces for a trajectory.
        joints: Whether to keep the joints.
    """

    def __init__(
        self,
        plants: Sequence[Plant],
        observers: Sequence[str],
        controller: Controller,
        metrics: Metrics,
        references: Baselines,
        *,
        keep: bool,
        joints: bool,
    ) -> None:
        self._axis = plants[0].axis
        self._bias = np.array([plant.bias for plant in plants])
        names, kinds = (tuple(plants[0].joint_names), plants[0].joint_kinds) if joints else ((), ())
        extras, worlds = controller.extra_signals, controller.worlds
        self._layout = Layout(tuple(observers), tuple(map(tuple, extras)), names, kinds)
        self._joints = joints
        self._estimated = [(*ESTIMATES, *names) for names in extras]
        self.metrics = metrics
        self._dt = controller.law.dt
        self._references = references
        self._keep = keep
        self._single = isinstance(worlds, int)
        self._waiting: list[tuple] = []
        self._kept: list[list[np.ndarray]] = [[] for _ in self._layout.columns()]

    def add(
        self, q: Joints, v: Joints, tick: Tick, body_rate: Scalar, torque: Scalar, running: np.ndarray | None
    ) -> None:
        """Take one tick.

        Args:
            q: Joint angles at the tick [rad].
            v: Joint rates at the tick [rad/s].
            tick: What the controller measured and decided.
            body_rate: Rate of the frame along the tilt axis, as a perfect gyro on it shows [rad/s].
            torque: The push, a float, or (n_worlds,) [N m].
            running: Which worlds have not ended, (n_worlds,); None for one world.
        """
        if not self._single:  # a row of all sensors' readings, which would be held as long
            body_rate = body_rate.copy()
        self._waiting.append((q, v, tick, body_rate, torque, running))
        if len(self._waiting) >= TICKS_A_PIECE:
            self.flush()

    def flush(self) -> None:
        """Make the waiting ticks into columns: to the metrics, and to the trajectory if it is kept."""
        if not self._waiting:
            return
        piece = self._piece(self._waiting)
        self._waiting = []
        self.metrics.update(piece, self._references.rates(piece.body_rate, piece.y1))
        if self._keep:
            columns, ended = piece.columns, piece.ended
            if ended is not None:
                columns = {name: np.where(ended, np.nan, column) for name, column in columns.items()}
            for kept, name in zip(self._kept, self._layout.columns(), strict=True):
                kept.append(columns[name])

    def _piece(self, waiting: Sequence[tuple]) -> TickBlock:
        qs, vs, ticks, body_rates, torques, runnings = zip(*waiting, strict=True)
        q, v = self._columns(qs), self._columns(vs)
        *signals, estimates = zip(*ticks, strict=True)
        y1, y2, acceleration, fog, u, x_e = self._columns(list(zip(*signals, strict=True)))
        body_rate = np.array(body_rates).reshape(u.shape)
        push = np.broadcast_to(self._columns([(torque,) for torque in torques])[0], u.shape)
        estimated = [self._columns(estimate) for estimate in zip(*estimates, strict=True)]
        x1 = self._axis.line.lean(q) + self._bias
        x2 = self._axis.line.rate(v)
        x3 = self._axis.gimbal_angle(q)
        ended = None if self._single else ~np.array(runnings)
        if ended is not None:
            x1 = np.where(ended, np.nan, x1)
        named = [dict(zip(names, parts, strict=True)) for names, parts in zip(self._estimated, estimated, strict=True)]
        joints = [*q, *v] if self._joints else []
        signals = [x1, x2, x3, y1, y2, acceleration, fog, u, x_e, push, *chain.from_iterable(estimated), *joints]
        return TickBlock(x1, x2, body_rate, x3, y1, fog, u, named, self._layout.named(signals), ended)

    def _columns(self, ticks: Sequence) -> np.ndarray:
        """Turn (n_ticks, n_signals[, n_worlds]) into (n_signals, n_ticks, n_worlds)."""
        if self._single:  # fromiter: np.array takes five times as long over nested sequences of floats
            flat = np.fromiter(chain.from_iterable(ticks), dtype=float)
            return flat.reshape(len(ticks), -1).T[:, :, None]
        return np.swapaxes(np.array(ticks), 0, 1)

    def trajectory(self) -> Trajectory | None:
        """Return all that was kept."""
        if not self._keep:
            return None
        for kept in self._kept:  # a column after the other: of a long run, all twice take much memory
            kept[:] = [np.concatenate([np.zeros((0, len(self._bias))), *kept])]
        return self._trajectory(self._kept, 0)

    def since(self, tick: int) -> Trajectory:
        """Return the ticks from one on, of one world whose trajectory is kept, as far as the run has come.

        Those that wait go on waiting: whoever looks on changes no number.
        """
        pieces = self._kept
        if self._waiting:
            waiting = self._piece(self._waiting).columns
            pieces = [[*kept, waiting[name]] for kept, name in zip(pieces, self._layout.columns(), strict=True)]
        return self._trajectory(pieces, tick)

    def _trajectory(self, pieces: Sequence[Sequence[np.ndarray]], first: int) -> Trajectory:
        """Join pieces of the columns, and take the rows from one on."""
        columns = {}
        for name, parts in zip(self._layout.columns(), pieces, strict=True):
            whole = parts[0] if len(parts) == 1 else np.concatenate([np.zeros((0, len(self._bias))), *parts])
            columns[name] = whole[first:, 0] if self._single else whole[first:]
        n_rows = sum(map(len, pieces[0]))
        return Trajectory({"time_s": np.arange(min(first, n_rows), n_rows) * self._dt, **columns}, layout=self._layout)


class MultiAxisRecorder:
    """The rows of a rig of several axes.

    Args:
        rows: Those of each axis, by its name; the first have the joints.
    """

    def __init__(self, rows: Mapping[str, TickRecorder]) -> None:
        self.rows = rows

    def trajectory(self) -> Trajectory | None:
        """Return all that was kept."""
        return self._joined({name: rows.trajectory() for name, rows in self.rows.items()})

    def since(self, tick: int) -> Trajectory:
        """Return the ticks from one on: see `TickRecorder.since`."""
        trajectory = self._joined({name: rows.since(tick) for name, rows in self.rows.items()})
        assert trajectory is not None
        return trajectory

    def _joined(self, trajectories: Mapping[str, Trajectory | None]) -> Trajectory | None:
        parts = {name: trajectory for name, trajectory in trajectories.items() if trajectory is not None}
        return Trajectory.joined(parts) if parts else None
