"""Ticks on their way to the metrics and, if kept, to the trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from cmg_mj.controller import Tick
from cmg_mj.elementwise import Scalar
from cmg_mj.metrics import Metrics
from cmg_mj.plant import Plant
from cmg_mj.references import References
from cmg_mj.trajectory import ESTIMATES, Layout, Trajectory

TICKS_A_PIECE = 256
"""So many ticks wait until they are made into columns together, which is much cheaper than one by one."""


class Rows:
    """Collects the ticks of one or many worlds.

    Args:
        plants: The rigs, one a world.
        observers: The observer in the loop, then the companions.
        extras: What each of them estimates beyond x.
        metrics: Takes every piece.
        references: What the estimates are judged beside.
        dt: Control period [s].
        keep: Whether to keep the pieces for a trajectory.
        single: Whether the ticks hold floats (one world) or arrays (n_worlds,).
    """

    def __init__(
        self,
        plants: Sequence[Plant],
        observers: Sequence[str],
        extras: Sequence[Sequence[str]],
        metrics: Metrics,
        references: References,
        dt: float,
        *,
        keep: bool,
        single: bool,
    ) -> None:
        self._axis = plants[0].axis
        self._bias = np.array([plant.bias for plant in plants])
        self._layout = Layout(
            tuple(observers), tuple(map(tuple, extras)), tuple(plants[0].joint_names), plants[0].joint_kinds
        )
        self._estimated = [(*ESTIMATES, *names) for names in extras]
        self._metrics = metrics
        self._references = references
        self._dt = dt
        self._keep = keep
        self._single = single
        self._waiting: list[tuple] = []
        self._pieces: list[list[np.ndarray]] = []

    def add(
        self, q: Sequence[Scalar], v: Sequence[Scalar], tick: Tick, torque: Scalar, running: np.ndarray | None
    ) -> None:
        """Take one tick.

        Args:
            q: Joint angles at the tick [rad].
            v: Joint rates at the tick [rad/s].
            tick: What the controller measured and decided.
            torque: The push, a float, or (n_worlds,) [N m].
            running: Which worlds have not ended, (n_worlds,); None for one world.
        """
        self._waiting.append((q, v, tick, torque, running))
        if len(self._waiting) >= TICKS_A_PIECE:
            self.flush()

    def flush(self) -> None:
        """Make the waiting ticks into columns: to the metrics, and to the trajectory if it is kept."""
        if not self._waiting:
            return
        qs, vs, ticks, torques, runnings = zip(*self._waiting, strict=True)
        self._waiting = []
        q, v = self._columns(qs), self._columns(vs)
        *signals, estimates = zip(*ticks, strict=True)
        y1, y2, acceleration, fog, u, x_e = self._columns(list(zip(*signals, strict=True)))
        push = np.broadcast_to(self._columns([(torque,) for torque in torques])[0], u.shape)
        estimated = [self._columns(estimate) for estimate in zip(*estimates, strict=True)]
        x1 = self._axis.line.lean(q) + self._bias
        x2 = self._axis.line.rate(v)
        x3 = self._axis.gimbal_angle(q)
        ended = None if self._single else ~np.array(runnings)
        if ended is not None:
            x1 = np.where(ended, np.nan, x1)
        named = [dict(zip(names, parts, strict=True)) for names, parts in zip(self._estimated, estimated, strict=True)]
        self._metrics.update(x1, x2, x3, u, fog, named, self._references.rates(x2), y1)
        if self._keep:
            columns = [
                x1,
                x2,
                x3,
                y1,
                y2,
                acceleration,
                fog,
                u,
                x_e,
                push,
                *(part for parts in estimated for part in parts),
                *q,
                *v,
            ]
            if ended is not None:
                columns = [np.where(ended, np.nan, column) for column in columns]
            self._pieces.append(columns)

    def _columns(self, ticks: Sequence) -> np.ndarray:
        """(n_ticks, n_signals[, n_worlds]) -> (n_signals, n_ticks, n_worlds)."""
        if self._single:  # fromiter: np.array takes five times as long over nested sequences of floats
            flat = np.fromiter(chain.from_iterable(ticks), dtype=float)
            return flat.reshape(len(ticks), -1).T[:, :, None]
        return np.swapaxes(np.array(ticks), 0, 1)

    def trajectory(self) -> Trajectory | None:
        """All that was kept."""
        if not self._keep:
            return None
        columns = {}
        names = self._layout.columns()
        for i, name in enumerate(names):
            whole = (
                np.concatenate([piece[i] for piece in self._pieces]) if self._pieces else np.zeros((0, len(self._bias)))
            )
            columns[name] = whole[:, 0] if self._single else whole
        n_ticks = len(columns[names[0]])
        return Trajectory({"time_s": np.arange(n_ticks) * self._dt, **columns}, layout=self._layout)
