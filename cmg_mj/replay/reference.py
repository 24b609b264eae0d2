"""Remarks on a log and its reference, in replays and in tuning."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.replay.alignment import Alignment, alignment
from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.log import REFERENCE

OFF = 0.05
"""Relative deviation of the reference's scale or offset from which it is reported."""
LATE = 0.1
"""Lag from which it is reported, in periods of the log's rows or its samples, the longer of the two."""
ALIKE = 0.5
"""Correlation below which tilt and reference are unrelated."""
AGREES = 0.95
"""Correlation at the best lag, of either sign, from which a cure is offered. If the tilt freezes half-way, neither lag
nor scale is meaningful."""
UNIT_NEAR = 1.1
"""A scale within this factor of a degree, or of its inverse, is probably a unit."""


def alignment_of(log: Log) -> Alignment | None:
    """Align a log's reference with its tilt; None without a reference, and for a run's recording."""
    if "reference" not in log.has or log.scenario is not None:
        return None
    tilts, references = ([log[name][part] for part in log.parts] for name in ("y1_rad", REFERENCE))
    return alignment(tilts, references, log.dt)


def remarks_on(log: Log, aligned: Alignment | None) -> list[str]:
    """Describe the changes to a log, and its reference.

    Args:
        log: The log.
        aligned: Alignment from `alignment_of`.

    Returns:
        Sentences.
    """
    lines = [f"{note[:1].upper()}{note[1:]}{'' if note.endswith('?') else '.'}" for note in log.notes]
    return lines if aligned is None else lines + _reference_remarks(log, aligned)


def _reference_remarks(log: Log, aligned: Alignment) -> list[str]:
    """Describe the reference's lag, scale and offset if they matter, with options that correct them."""
    lag, scale, offset, correlation = aligned
    if scale is None or offset is None or correlation is None:
        return ["The reference cannot be compared with the tilt: too little motion, or too short."]
    if correlation <= -AGREES:
        scale_now = log.options.scale.get("rate", 1.0)
        return [
            f"The reference does not go with the tilt (correlation {correlation:.2f}): it counts the other way: "
            f"--scale rate={-scale_now:g}."
        ]
    if abs(correlation) < ALIKE:
        return [
            f"The reference does not go with the tilt (correlation {correlation:.2f}): is it the rate of this tilt?"
        ]
    late = None if lag is None or abs(lag) <= LATE * max(log.dt, log.row_period_s or 0.0) else lag
    resized = abs(scale - 1.0) > OFF
    known = log[REFERENCE][np.isfinite(log[REFERENCE])]
    motion = math.sqrt(float(np.mean(known**2)))
    if correlation > 0.0 and lag is not None and late is None and not resized and abs(offset) <= OFF * motion:
        return []
    if correlation < AGREES:
        return [
            f"Tilt and reference hardly agree (correlation {correlation:.2f} at the best lag; below {AGREES:g} neither "
            "delay nor scale is offered): look at the log, whether one of them stands still, leaps or is noise."
        ]
    when = "an unknown time" if lag is None else f"{abs(lag) * 1e3:.2f} ms {'behind' if lag >= 0.0 else 'before'}"
    sign = "plus" if offset >= 0.0 else "less"
    times = f"{scale:.4f}" if scale > 0.1 else f"{scale:.4g}"
    remark = f"Beside the tilt the reference comes {when}; {times} times it {sign} {abs(offset):.4f} rad/s fits"
    cures = [f"--delay {late:.4f}"] if late is not None else []
    cures += [f"--scale rate={scale:.4g}"] if resized else []
    corrected = log.options.delay_s or log.options.scale or log.options.offset
    beyond = "beyond what was set; " if corrected else ""
    cure = f" ({beyond}to take it out: {' '.join(cures)})" if cures else ""
    return [remark + cure + (_unit_question(log, scale) or ".")]


def _unit_question(log: Log, scale: float) -> str | None:
    """Ask for the unit if a reference's scale is that of degrees taken as radians, or the other way."""
    units = log.options.units
    for factor, rate, tilt in ((math.pi / 180.0, "deg/s", "rad"), (180.0 / math.pi, "rad/s", "deg")):
        if 1.0 / UNIT_NEAR < scale / factor < UNIT_NEAR:
            tilts = f", or the tilt {tilt}" if "tilt" in units and units["tilt"] != tilt else ""
            return f": is it {rate}{tilts}?"
    return None
