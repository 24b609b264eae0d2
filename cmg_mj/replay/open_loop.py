"""An observer replayed open loop on what a run, or a log, recorded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from cmg_mj.core.types import extra_signals
from cmg_mj.elementwise import Scalar
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
    pieces = list(replay_stretches(observer, trajectory))
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def replay_stretches(observer: Observer, trajectory: Trajectory) -> Iterator[dict[str, np.ndarray]]:
    """Replay as `replay_all` does, a stretch after the other; the observer goes on where the last one ended."""
    names = (*ESTIMATES, *extra_signals(observer))
    state, held = None, None
    for part in trajectory.stretches():
        stretch = trajectory.rows(part)
        y1, y2, u = (_rows(stretch[name]) for name in ("y1_rad", "y2_rad", "u_rad_s"))
        measured = stretch.columns.get("acceleration_rad_s2")
        acceleration = _rows(np.full_like(stretch["y1_rad"], np.nan) if measured is None else measured)
        rows: list[Sequence[Scalar]] = []
        for k in range(len(y1)):
            measurement = Measurement(y1[k], y2[k], acceleration[k])
            if held is None:
                zero = 0.0 * y1[k]
                state = observer.init(measurement)
                rows.append((y1[k], zero, y2[k], *[zero] * (len(names) - len(ESTIMATES))))
            else:
                state, estimate = observer.step(state, measurement, held)
                rows.append(estimate)
            held = u[k]
        shape = stretch["y1_rad"].shape
        columns = zip(*(row[: len(names)] for row in rows), strict=True)
        yield {name: np.array(column, dtype=float).reshape(shape) for name, column in zip(names, columns, strict=True)}


def _rows(values: np.ndarray) -> Sequence[Scalar] | np.ndarray:
    """Return ticks as the observers take them: floats (one world) or arrays (n_worlds,)."""
    return values.tolist() if values.ndim == 1 else np.ascontiguousarray(values)
