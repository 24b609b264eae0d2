"""Readings of a recorded run that several papers need."""

from __future__ import annotations

import numpy as np

from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory


def trajectory_of(result: Result) -> Trajectory:
    """Return the recording of a result that kept it."""
    assert result.trajectory is not None
    return result.trajectory


def push_intervals(trajectory: Trajectory) -> list[tuple[float, float]]:
    """Find when the push acted on one world, as panels shade it [s]."""
    times = trajectory["time_s"][trajectory["push_n_m"] != 0.0]
    return [(float(times[0]), float(times[-1]))] if len(times) else []


def rms(values: np.ndarray) -> np.ndarray:
    """Return the root of the mean square over the ticks, (n_ticks, ...) -> (...)."""
    return np.sqrt(np.mean(values**2, axis=0))
