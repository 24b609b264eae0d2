"""What a reference is to a measured tilt: how far it comes behind, its scale and its offset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.replay.lag import lag

FAINT = 0.1
"""Enough for a measured tilt's slopes: most of them may be noise, which is white and has no peak of its own."""
SPAN_S = 0.2
"""A reference's size is taken from how far it says the tilt has come in so long [s]."""


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
    """Compare a reference with the tilt's central difference (lag), its integral with the tilt (scale, offset).

    Over `SPAN_S` each, the tilt's increments are fitted by those of the reference's integral, taken back by its lag.

    Args:
        tilt: Its pieces, each (n,) [rad].
        reference: The pieces of the rate [rad/s]; NaN where it is not known.
        dt: Sample period [s].

    Returns:
        The four numbers; None for those that cannot be found.
    """
    slopes = [np.gradient(piece, dt) for piece in tilt]
    found = lag(reference, slopes, dt, least=FAINT, sure=False)
    span = max(2, round(SPAN_S / dt))
    rises, travels = [], []
    for y, rate in zip(tilt, reference, strict=True):
        if len(y) <= 2 * span:
            continue
        clock = np.arange(len(y)) * dt
        steps = (rate[1:] + rate[:-1]) * dt / 2.0
        unknown = np.concatenate([[0], np.cumsum(np.isnan(steps))])
        travelled = np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])
        when = clock + (found or 0.0)
        travelled, unknown = (np.interp(when, clock, sums, left=np.nan, right=np.nan) for sums in (travelled, unknown))
        gapless = unknown[span:] == unknown[:-span]
        rises.append((y[span:] - y[:-span])[gapless])
        travels.append((travelled[span:] - travelled[:-span])[gapless])
    if not rises:
        return Alignment(found, None, None, None)
    rise, travel = np.concatenate(rises), np.concatenate(travels)
    if len(rise) < 3 or not np.ptp(travel) > 0.0 or not np.ptp(rise) > 0.0:
        return Alignment(found, None, None, None)
    correlation = float(np.corrcoef(rise, travel)[0, 1])
    slope, start = np.polynomial.polynomial.polyfit(travel, rise, 1)[::-1]
    return Alignment(found, float(slope), float(start / (span * dt)), correlation)
