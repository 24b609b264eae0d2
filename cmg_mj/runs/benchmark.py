"""Times an observer's update."""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.observers import Measurement, Observer

REPEATS = 7

Signal = Sequence[Scalar] | np.ndarray


def time_of_update(observer: Observer, y1: Signal, y2: Signal, acceleration: Signal, u: Signal) -> float:
    """Microseconds of one update along given signals, the median of some repeats.

    Args:
        observer: The observer.
        y1: Measured tilt, (n_ticks,) floats or (n_ticks, n_worlds) [rad].
        y2: Measured gimbal angle, the same [rad].
        acceleration: Measured angular acceleration of the tilt, the same [rad/s^2].
        u: Gimbal rate, the same [rad/s].

    Returns:
        The time [us].
    """
    samples = [(Measurement(*y), held) for *y, held in zip(y1, y2, acceleration, u, strict=True)]
    times = []
    with np.errstate(all="ignore"):  # worlds that have fallen are NaN
        for _ in range(REPEATS):
            state = observer.init(samples[0][0])
            start = time.perf_counter()
            for y, held in samples:
                state, _ = observer.step(state, y, held)
            times.append((time.perf_counter() - start) / len(samples) * 1e6)
    return statistics.median(times)
