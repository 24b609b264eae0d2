"""An angle that starts again after a turn, made to run on; single rows that leap out and back, which are no turn."""

from __future__ import annotations

import math

import numpy as np

A_TURN = 1.5 * math.pi
"""A larger step of the tilt from one row to the next is an angle that starts again, not a motion [rad]."""
A_FLICKER = 0.2
"""Noise makes an angle near the end of its turn come back at once, a turn less at most so much away [rad]."""


def turned(angle: np.ndarray, notes: list[str]) -> np.ndarray:
    """An angle that starts again after a turn, made to run on. A row that leaps out and back is no turn: it stays."""
    known = np.flatnonzero(np.isfinite(angle))
    spikes = _spikes(angle[known])
    if len(spikes):
        rows = f"row {known[spikes[0]] + 1}"
        where = f"in {rows} alone" if len(spikes) == 1 else f"in {len(spikes):,} single rows, first {rows}"
        size = math.degrees(angle[known[spikes[0]]] - angle[known[spikes[0] - 1]])
        notes.append(f"the tilt leaps by {size:.4g} deg and back {where}: a spike, kept as it is")
    smooth = np.delete(known, spikes)
    jumps = int((np.abs(np.diff(angle[smooth])) > A_TURN).sum())
    if not jumps:
        return angle
    notes.append(f"the tilt jumps by a turn {jumps:,} time{'' if jumps == 1 else 's'}: made to run on")
    out = angle.copy()
    out[smooth] = np.unwrap(angle[smooth])
    before = known[spikes - 1]
    out[known[spikes]] += out[before] - angle[before]
    return out


def _spikes(angle: np.ndarray) -> np.ndarray:
    """Places of single values that leap out and back and are no angle near the end of a turn that flickers."""
    steps = np.diff(angle)
    out, back = steps[:-1], steps[1:]
    leaps = (np.abs(out) > A_TURN) & (np.abs(back) > A_TURN) & (out * back < 0.0)
    if not leaps.any():
        return np.flatnonzero(leaps)
    # AngleSource that start again lie within one turn: what leaps out of that, or by less than a turn, has not.
    others, middle = np.delete(angle, np.flatnonzero(leaps) + 1), angle[1:-1]
    reach = np.maximum(middle, others.max()) - np.minimum(middle, others.min())
    short = np.abs(np.abs(out) - 2.0 * math.pi) > 5.0 * np.median(np.abs(steps)) + A_FLICKER
    flickers = (reach < 2.0 * math.pi + 1e-6) & ~short
    return np.flatnonzero(leaps & ~flickers) + 1
