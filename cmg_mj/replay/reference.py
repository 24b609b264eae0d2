"""What is said of a log and its reference before anything is judged, in replays and in tuning."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.replay.alignment import Alignment, alignment
from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.log import REFERENCE

OFF = 0.05
"""A reference whose size differs by more from what the tilt shows is worth a word."""
LATE = 0.1
"""So is one that is late by more than this much of a period of the log's rows, or of its samples if these are rarer."""
ALIKE = 0.5
"""Tilt and reference that correlate less have nothing to do with each other."""
AGREES = 0.95
"""Only if they correlate so far at the best lag, or oppose each other so far, is a cure offered: of a tilt that freezes
half-way neither lag nor scale is worth anything."""
UNIT_NEAR = 1.1
"""A scale within this factor of a degree, or of its inverse, is probably a unit."""


def alignment_of(log: Log) -> Alignment | None:
    """What a log's reference is to its tilt; None without one, and of a run's recording, whose truth it is."""
    if "reference" not in log.has or log.scenario is not None:
        return None
    tilts, references = ([log[name][part] for part in log.parts] for name in ("y1_rad", REFERENCE))
    return alignment(tilts, references, log.dt)


def remarks_on(log: Log, found: Alignment | None) -> list[str]:
    """What was done to a log, and what its reference is.

    Args:
        log: The log.
        found: By `alignment_of`.

    Returns:
        Sentences.
    """
    lines = [f"{note[:1].upper()}{note[1:]}{'' if note.endswith('?') else '.'}" for note in log.notes]
    return lines if found is None else lines + _of_the_reference(log, found)


def _of_the_reference(log: Log, found: Alignment) -> list[str]:
    """The reference's lag, size and offset if they matter, and what would take them out: no line, or one."""
    lag, scale, offset, correlation = found
    if scale is None or offset is None or correlation is None:
        return ["The reference cannot be compared with the tilt: too little motion, or too short."]
    if correlation <= -AGREES:
        scale_now = dict(log.given.get("scale", {})).get("rate", 1.0)
        return [
            f"The reference does not go with the tilt (correlation {correlation:.2f}): it counts the other way: "
            f"--scale rate={-scale_now:g}."
        ]
    if abs(correlation) < ALIKE:
        return [
            f"The reference does not go with the tilt (correlation {correlation:.2f}): is it the rate of this tilt?"
        ]
    late = None if lag is None or abs(lag) <= LATE * max(log.dt, log.rows_s or 0.0) else lag
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
    said = f"Beside the tilt the reference comes {when}; {times} times it {sign} {abs(offset):.4f} rad/s fits"
    cures = [f"--delay {late:.4f}"] if late is not None else []
    cures += [f"--scale rate={scale:.4g}"] if resized else []
    beyond = "beyond what was set; " if {"delay_s", "scale", "offset"} & log.given.keys() else ""
    cure = f" ({beyond}to take it out: {' '.join(cures)})" if cures else ""
    return [said + cure + (_a_unit(log, scale) or ".")]


def _a_unit(log: Log, scale: float) -> str | None:
    """Whether a reference's scale is that of degrees taken as radians, or the other way."""
    units = log.given.get("units", {})
    for factor, rate, tilt in ((math.pi / 180.0, "deg/s", "rad"), (180.0 / math.pi, "rad/s", "deg")):
        if 1.0 / UNIT_NEAR < scale / factor < UNIT_NEAR:
            tilts = f", or the tilt {tilt}" if "tilt" in units and units["tilt"] != tilt else ""
            return f": is it {rate}{tilts}?"
    return None
