"""The tilt from one accelerometer, and remarks on what motion does to it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.replay.logs.acceleration_checks import NEAR, cure_of_size
from cmg_mj.replay.logs.columns import ONE_ACCELEROMETER, Column
from cmg_mj.replay.logs.log import REFERENCE
from cmg_mj.replay.logs.units import in_si
from cmg_mj.results.stored_columns import number_of_rows, select_rows, stretches

RADIUS_M = 0.1
"""Distance from the pivot for which the error of the tilt is told [m]."""
SPAN_S = 0.05
"""Time over which the gyro's increments give its angular acceleration [s]: the slope between samples is noise."""


def tilt_of_one(ax: np.ndarray, az: np.ndarray) -> np.ndarray:
    """Return the tilt that one accelerometer at rest shows.

    Args:
        ax: Specific force along the motion of a growing tilt, -g sin(tilt) at rest, (n,) [m/s^2].
        az: Specific force outward along the tilting line, g cos(tilt) at rest, (n,) [m/s^2].

    Returns:
        (n,) [rad].
    """
    return np.arctan2(-ax, az)


def motion_error(tilt: np.ndarray, rate: np.ndarray, dt: float) -> np.ndarray:
    """Return to first order how far turning about a pivot puts off the tilt, for each metre of distance.

    At the radius r the specific force is (r y'' - g sin y, g cos y - r y'^2), and atan2(-ax, az) is y less
    r (y'' cos y - y'^2 sin y)/g.

    Args:
        tilt: y, (n,) [rad].
        rate: y', (n,) [rad/s].
        dt: Sample period [s].

    Returns:
        Of the samples that have others on either side within `SPAN_S`, (n - 2 m,) [rad/m].
    """
    m = _half_span(dt)
    acceleration = (rate[2 * m :] - rate[: -2 * m]) / (2 * m * dt)
    y, w = tilt[m:-m], rate[m:-m]
    return -(acceleration * np.cos(y) - w**2 * np.sin(y)) / STANDARD_GRAVITY


def _half_span(dt: float) -> int:
    return max(1, round(SPAN_S / 2.0 / dt))


def remarks_on_one(
    columns: Mapping[str, Column],
    signals: Mapping[str, np.ndarray],
    sampled: Mapping[str, np.ndarray],
    parts: Sequence[slice],
    dt: float,
) -> list[str]:
    """Describe what motion does to the tilt of one accelerometer, and a wrong size or direction.

    Args:
        columns: Role -> column.
        signals: Role -> values in SI units, (n_rows,).
        sampled: The log's columns.
        parts: Slices of the log without a gap.
        dt: Sample period [s].

    Returns:
        Lines; the first is there always.
    """
    size = np.concatenate([_size(signals, rows) for rows in stretches(number_of_rows(signals))])
    usual = float(np.median(size)) / STANDARD_GRAVITY
    size -= usual * STANDARD_GRAVITY
    shakes = float(np.sqrt(np.mean(size**2))) / STANDARD_GRAVITY
    del size  # of a long log, a column takes much memory
    upward = float(np.nanmedian(signals["az"]))
    line = (
        "the tilt is that of one accelerometer, atan2(-ax, az): an acceleration a of its place puts it off by about "
        f"a/g, 0.1 g by {math.degrees(0.1):.1f} deg"
    )
    error = _rms_motion_error(sampled, parts, dt)
    if error is None:
        line += f"; the specific force's size varies by {shakes:.2g} g RMS (horizontal motion hardly shows in it)"
    else:
        line += (
            f"; the turning that the reference shows puts it off by {math.degrees(error * RADIUS_M):.2g} deg RMS at "
            f"{RADIUS_M:g} m from the pivot, and in proportion to that distance elsewhere"
        )
    lines = [line]
    if not NEAR[0] <= usual <= NEAR[1] and usual > 0.0:
        cure = cure_of_size(columns, dict.fromkeys(ONE_ACCELEROMETER, usual))
        lines.append(f"the accelerometer's specific force is {usual:.4g} times gravity's 9.81 m/s^2 (median): {cure}")
    if upward < 0.0:
        turned = ",".join(f"{role}={-_scale(columns[role]):g}" for role in ONE_ACCELEROMETER)
        lines.append(
            f"the median of az is {upward / STANDARD_GRAVITY:.2g} g, so the tilt is beyond 90 deg: --scale {turned} if "
            f"the sensor shows gravity itself, --scale az={-_scale(columns['az']):g} if it is mounted upside down"
        )
    return lines


def _size(signals: Mapping[str, np.ndarray], rows: slice) -> np.ndarray:
    """Return the size of the specific force in those of some rows that have both parts [m/s^2]."""
    some = select_rows(signals, rows)
    size = np.hypot(some["ax"], some["az"])
    return size[np.isfinite(size)]


def _scale(column: Column) -> float:
    """Return the user's own factor of a column of acceleration."""
    return column.factor / in_si("acceleration", column.unit)


def _rms_motion_error(sampled: Mapping[str, np.ndarray], parts: Sequence[slice], dt: float) -> float | None:
    """Return the RMS of `motion_error` [rad/m]; None without a reference."""
    m, total, count = _half_span(dt), 0.0, 0
    for part in parts:
        for some in stretches(part.stop - part.start):
            rows = slice(part.start + max(0, some.start - m), min(part.stop, part.start + some.stop + m))
            if rows.stop - rows.start > 2 * m:
                stretch = select_rows(sampled, rows)
                error = motion_error(stretch["y1_rad"], stretch[REFERENCE], dt)
                error = error[np.isfinite(error)]
                total, count = total + float(np.sum(error**2)), count + len(error)
    return math.sqrt(total / count) if count else None
