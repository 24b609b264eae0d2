"""Stamps of rows: whether they are even, as far as they can tell."""

from __future__ import annotations

import numpy as np

EVEN = 0.02
"""Stamps this much of a period off an even grid count as on it."""
A_GAP = 1.5
"""More than so many periods between two rows is a gap."""


def rounded(period: float) -> float:
    """The period of a rate that is a round number, if this is one to the stamps' accuracy."""
    rate = float(f"{1.0 / period:.6g}")
    return 1.0 / rate if abs(period * rate - 1.0) < 1e-9 else period


def resolution_of(time: np.ndarray) -> float:
    """The largest of 1, 0.1, 0.01 ... s that all stamps are multiples of, from the first [s]; 0 if none is."""
    for power in range(0, 8):
        counts = (time - time[0]) * 10.0**power
        if np.abs(counts - np.rint(counts)).max() < 1e-3:
            return 10.0**-power
    return 0.0


def is_even(time: np.ndarray, period: float, resolution: float) -> bool:
    """Whether the rows are on an even grid, as far as stamps of this resolution tell."""
    if len(time) < 3:
        return True
    places = np.rint((time - time[0]) / period)
    slack = max(EVEN * period, 0.75 * resolution if resolution < period else 0.0)
    if np.ptp(np.diff(time)) < EVEN * period:
        return True
    order = np.arange(len(time)) if np.diff(time).max() < A_GAP * period else places
    fit = np.polynomial.polynomial.polyfit(order, time - time[0], 1)
    off = time - time[0] - (fit[0] + fit[1] * order)
    return bool(np.abs(off).max() <= slack and abs(fit[1] / period - 1.0) < 1e-3)
