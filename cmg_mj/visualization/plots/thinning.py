"""Thins long signals to what a plot can show of them."""

from __future__ import annotations

import numpy as np

from cmg_mj.results.trajectory import STRETCH

DRAWN = 8000
"""Number of samples that are left of a long signal: several for each pixel across a plot."""


def thinned(time: np.ndarray, values: np.ndarray, drawn: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Select the samples that make the outline of a signal: the lowest and the highest of each short span of time.

    Args:
        time: Times, (n,) [s].
        values: Values, (n,).
        drawn: Number of samples to leave of any signal; None to leave `DRAWN` of one longer than `STRETCH`.

    Returns:
        Times and values.
    """
    if len(time) <= (drawn or STRETCH):
        return time, values
    width = -(-2 * len(time) // (drawn or DRAWN))
    n_spans = len(time) // width
    spans = values[: n_spans * width].reshape(n_spans, width)
    lowest = np.argmin(np.where(np.isnan(spans), np.inf, spans), axis=1)
    highest = np.argmax(np.where(np.isnan(spans), -np.inf, spans), axis=1)
    pairs = np.sort([lowest, highest], axis=0) + width * np.arange(n_spans)
    rest = np.arange(n_spans * width, len(time))
    rows = np.unique(np.concatenate([[0], pairs.T.ravel(), rest, [len(time) - 1]]))
    return time[rows], values[rows]
