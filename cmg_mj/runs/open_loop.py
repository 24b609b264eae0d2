"""An observer replayed open loop on what a run, or a log, recorded."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.one_by_one import for_worlds
from cmg_mj.core.types import STATE_SIGNALS, extra_signals
from cmg_mj.observers import Estimate, Measurement, Observer
from cmg_mj.results.trajectory import GYRO, Trajectory


def replay(observer: Observer, trajectory: Trajectory) -> Estimate:
    """Replay an observer on recorded measurements: y1, y2, command u and, if recorded, angular acceleration and gyro.

    The observer runs open loop, whatever the loop was closed on. From the first row on, its estimates are bitwise
    those of an open-loop observer in the same run.

    Args:
        observer: The observer; its sample period must be the trajectory's.
        trajectory: One world or many. It may begin in the middle of a run: the observer starts at its first row.

    Returns:
        Estimates of x1 [rad], x2 [rad/s] and x3 [rad], each of the recorded columns' shape, (n_ticks,) or
        (n_ticks, n_worlds); NaN after a world's end.
    """
    signals = replay_all(observer, trajectory)
    return Estimate(*(signals[name] for name in STATE_SIGNALS))


def replay_all(observer: Observer, trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Replay as `replay` does; return x and the observer's other estimates (zero at the first row) by name."""
    y1 = trajectory["y1_rad"]
    acceleration, gyro = (
        trajectory.columns.get(name, np.full_like(y1, np.nan)) for name in ("acceleration_rad_s2", GYRO)
    )
    measurements = map(Measurement, *map(_rows, (y1, trajectory["y2_rad"], acceleration, gyro)))
    first = next(measurements)
    columns = {name: np.empty(y1.shape) for name in (*STATE_SIGNALS, *extra_signals(observer))}
    for column in columns.values():
        column[0] = 0.0 * first.y1
    columns["x1_rad"][0], columns["x3_rad"][0] = first.y1, first.y2
    if y1.ndim > 1:
        observer = for_worlds(observer)
    state = observer.init(first)
    for row, (measurement, u) in enumerate(zip(measurements, _rows(trajectory["u_rad_s"]), strict=False), 1):
        state, estimate = observer.step(state, measurement, u)
        for column, value in zip(columns.values(), estimate, strict=False):
            column[row] = value
    return columns


def _rows(values: np.ndarray) -> Iterator[Scalar]:
    """Return ticks as the observers take them: floats (one world) or arrays (n_worlds,)."""
    contiguous = np.ascontiguousarray(values, dtype=float)
    return iter(contiguous.data if values.ndim == 1 else contiguous)
