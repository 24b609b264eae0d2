"""An observer replayed open loop on what a run, or a log, recorded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.types import extra_signals
from cmg_mj.observers import Estimate, Measurement, Observer
from cmg_mj.results.trajectory import ESTIMATES, Trajectory


def replay(observer: Observer, trajectory: Trajectory) -> Estimate:
    """Replay an observer on recorded measurements: y1, y2, angular acceleration (if recorded) and command u.

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
    return Estimate(*(signals[name] for name in ESTIMATES))


def replay_all(observer: Observer, trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Replay as `replay` does; return x and the observer's other estimates (zero at the first row) by name."""
    names = (*ESTIMATES, *extra_signals(observer))
    rows = _steps(observer, trajectory, len(names))
    shape = trajectory["y1_rad"].shape
    if len(shape) == 1:  # no list: of a long log, floats of Python take much memory
        columns = np.fromiter(chain.from_iterable(rows), dtype=float).reshape(-1, len(names)).T.copy()
    else:
        columns = zip(*rows, strict=True)
    return {name: np.array(column, dtype=float).reshape(shape) for name, column in zip(names, columns, strict=True)}


def _steps(observer: Observer, trajectory: Trajectory, n_names: int) -> Iterator[Sequence[Scalar]]:
    """Yield the estimates row by row."""
    y1, y2, held = (_rows(trajectory[name]) for name in ("y1_rad", "y2_rad", "u_rad_s"))
    measured = trajectory.columns.get("acceleration_rad_s2")
    acceleration = _rows(np.full_like(trajectory["y1_rad"], np.nan) if measured is None else measured)
    measurements = map(Measurement, y1, y2, acceleration)
    first = next(measurements)
    state = observer.init(first)
    zero = 0.0 * first.y1
    yield (first.y1, zero, first.y2, *[zero] * (n_names - len(ESTIMATES)))
    for measurement, u in zip(measurements, held, strict=False):
        state, estimate = observer.step(state, measurement, u)
        yield estimate[:n_names]


def _rows(values: np.ndarray) -> Iterator[Scalar]:
    """Return ticks as the observers take them: floats (one world) or arrays (n_worlds,)."""
    contiguous = np.ascontiguousarray(values, dtype=float)
    return iter(contiguous.data if values.ndim == 1 else contiguous)
