"""What a reference is to a measured tilt: how far it comes behind, its scale and its offset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.replay.lag import lag

SPAN_S = 0.2
"""A reference is compared by how far it says that the tilt has come in so long [s]: slopes are mostly noise."""


class Alignment(NamedTuple):
    """What a reference is to the measured tilt, found from the two alone."""

    lag_s: float | None
    """How far it comes behind the tilt, as it was read [s]."""
    scale: float | None
    """By what it must be multiplied to say how far the tilt has come."""
    offset_rad_s: float | None
    """What must be added then [rad/s]."""
    correlation: float | None
    """Of its increments with the tilt's: near -1 if it counts the other way."""


def alignment(tilt: Sequence[np.ndarray], reference: Sequence[np.ndarray], dt: float) -> Alignment:
    """Compare how far the tilt comes in `SPAN_S`, at every sample, with how far the reference says so.

    The lag is where the two are most alike; the tilt's increments are then fitted by the reference's, taken back by it.

    Args:
        tilt: Its pieces, each (n,) [rad].
        reference: The pieces of the rate [rad/s]; NaN where it is not known.
        dt: Sample period [s].

    Returns:
        The four numbers; None for those that cannot be found.
    """
    span = max(2, round(SPAN_S / dt))
    pieces = [(y, rate) for y, rate in zip(tilt, reference, strict=True) if len(y) > 2 * span]
    rises = [y[span:] - y[:-span] for y, _ in pieces]
    found = lag([_travelled(rate, span, dt, 0.0) for _, rate in pieces], rises, dt)
    travels = [_travelled(rate, span, dt, found or 0.0) for _, rate in pieces]
    if not rises:
        return Alignment(found, None, None, None)
    rise, travel = np.concatenate(rises), np.concatenate(travels)
    rise, travel = rise[np.isfinite(travel)], travel[np.isfinite(travel)]
    if len(rise) < 3 or not np.ptp(travel) > 0.0 or not np.ptp(rise) > 0.0:
        return Alignment(found, None, None, None)
    correlation = float(np.corrcoef(rise, travel)[0, 1])
    slope, start = np.polynomial.polynomial.polyfit(travel, rise, 1)[::-1]
    return Alignment(found, float(slope), float(start / (span * dt)), correlation)


def _travelled(rate: np.ndarray, span: int, dt: float, late_s: float) -> np.ndarray:
    """How far a rate goes in each span of samples, when it comes so late; NaN over what is not known, (n - span,)."""
    clock = np.arange(len(rate)) * dt
    steps = (rate[1:] + rate[:-1]) * dt / 2.0
    unknown = np.concatenate([[0], np.cumsum(np.isnan(steps))])
    travelled = np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])
    when = clock + late_s
    travelled, unknown = (np.interp(when, clock, sums, left=np.nan, right=np.nan) for sums in (travelled, unknown))
    return np.where(unknown[span:] == unknown[:-span], travelled[span:] - travelled[:-span], np.nan)
