"""Clipping: the rows in which a sensor stands at an end of its range."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from cmg_mj.features.replay.log import Column, Values
from cmg_mj.features.replay.white_noise import smallest_step

CLIPPED = 5
"""Fewest rows at an end of a signal's range for which its sensor counts as clipped."""
STEEP = 32.0
"""Fall in two rows beside them, in smallest steps by rows (up to ten): a parabola in steps falls by 16."""
REST = 0.05
"""A tilt that stands while its rate is below this share of its largest is at rest."""


def clipped_rows(signals: Values, columns: Mapping[str, Column], notes: list[str]) -> np.ndarray:
    """Find the rows in which a sensor stands at an end of its range, and note them, (n_rows,).

    A signal that comes to its end quickly, stays there for longer than elsewhere, and leaves quickly is clipped. A
    quantised one turns in few steps.
    """
    clipped = np.zeros(len(next(iter(signals.values()))), dtype=bool)
    rate = np.abs(signals.get("rate", np.where(clipped, 0.0, np.nan)))
    meaning = "clipped, and the reference is not compared there" if "rate" in signals else "clipped, or at a stop"
    for role, values in signals.items():
        if role == "command" or role.startswith("gimbal"):
            continue  # which stand at their ends by right
        (name, _, factor, offset), around = columns[role], np.pad(values, 2, constant_values=math.nan)
        usual = np.median(np.diff(np.flatnonzero(np.diff(values, prepend=math.nan, append=math.nan))))
        steep = STEEP * smallest_step(values[np.isfinite(values)])
        found = []
        for end, word in ((np.fmax.reduce(values), "largest"), (np.fmin.reduce(values), "smallest")):
            n_rows, at_end = 0, values == end
            for start, stop in np.flatnonzero(np.diff(at_end, prepend=False, append=False)).reshape(-1, 2):
                fall = np.fmin.reduce(np.abs(around[[start, stop + 3]] - end))
                rests = role == "tilt" and np.median(rate[start:stop]) < REST * np.fmax.reduce(rate)
                if stop - start > 2.0 * usual and fall * min(stop - start, 10) > steep and not rests:
                    n_rows += stop - start
            if n_rows >= CLIPPED:
                clipped |= at_end
                found.append(f"{at_end.sum():,} rows at its {word} value, {(end - offset) / factor:.6g}")
        if found:
            notes.append(f"{name!r} stands {', and '.join(found)}: {meaning}")
    return clipped
