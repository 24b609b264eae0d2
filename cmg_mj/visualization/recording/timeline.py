"""A recording's only timeline."""

from __future__ import annotations

import numpy as np
import rerun as rr

TIMELINE = "sim_time"
"""Simulated time from the start of the run."""


def instant(seconds: float) -> np.timedelta64:
    """A moment, rounded to the nanosecond (rerun itself would cut it off)."""
    return np.timedelta64(round(seconds * 1e9), "ns")


def column(seconds: np.ndarray, timeline: str = TIMELINE) -> rr.TimeColumn:
    """Moments, (n,) [s], as a column."""
    return rr.TimeColumn(timeline, duration=np.rint(seconds * 1e9).astype("timedelta64[ns]"))
