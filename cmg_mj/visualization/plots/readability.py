"""What keeps a picture of many lines legible: the best few of them, on an axis that those fill."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any, Literal

import numpy as np

from cmg_mj.visualization.plots.colours import BASELINE_COLOURS

FEW = 3
"""This many observers can be followed over each other."""

JUDGED_BY = ("velocity_rms_error_push_rad_s", "velocity_rms_error_rad_s")
"""Keys of a summary, the first of them that it has: a whole run is mostly stillness."""

LEFT_OUT = 0.1
"""Percentage of the samples at each end of an estimate that its axis need not show."""

REACH = 3.0
"""An estimate that goes astray stretches its axis by this many times the span of what is true, on each side."""

MARGIN = 0.05

LEGEND = (0.35, 0.6)
"""Shares of a plot's width and height that a legend takes."""


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Observers' names as legends and tables have room for them.

    Args:
        names: Those that are shown together.

    Returns:
        Name -> itself; of a dotted path its class, unless another one's is called the same.
    """
    short = [name.rpartition(":")[2] or name for name in names]
    return {name: part if short.count(part) == 1 else name for name, part in zip(names, short, strict=True)}


def figures_by_observer(observers: Sequence[str], summary: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """A run's numbers observer by observer.

    Args:
        observers: The one in the loop, then those riding along.
        summary: The run's, with the others' in `open_loop_observers`.

    Returns:
        Observer -> its numbers, in that order; empty for one that has none.
    """
    in_loop, *others = observers
    riding = summary.get("open_loop_observers") or {}
    return {in_loop: summary, **{name: riding.get(name, {}) for name in others}}


def observers_to_draw(summaries: Mapping[str, Mapping[str, Any]], always: Iterable[str] = ()) -> list[str]:
    """Those worth being shown when there are too many.

    Args:
        summaries: Of each observer its summary; one that fell has `fell`, and comes last.
        always: Those shown in any case.

    Returns:
        At most `FEW` names (more only if `always` has more), in the order given: those with the smallest errors. What
        observers are compared with is not among them, unless there is too little else.
    """
    always = list(always)
    rest = sorted((name for name in summaries if name not in always), key=lambda name: _rank(name, summaries[name]))
    shown = {*always, *rest[: max(0, FEW - len(always))]}
    return [name for name in summaries if name in shown]


def _rank(name: str, summary: Mapping[str, Any]) -> tuple[bool, bool, float]:
    error = next((summary[key] for key in JUDGED_BY if summary.get(key) is not None), math.inf)
    return name in BASELINE_COLOURS, bool(summary.get("fell")), error if math.isfinite(error) else math.inf


def axis_range(sure: Sequence[np.ndarray], rather: Sequence[np.ndarray] = ()) -> tuple[float, float] | None:
    """The range of an axis which one noisy or diverging line cannot take for itself.

    Args:
        sure: What must be seen whole, arrays of any shape. Whatever is not finite is passed over, here as below.
        rather: What should be seen too, but for its outliers, and as long as it leaves room for the others.

    Returns:
        Lowest and highest, with a margin; None if there is nothing, or all of it one value.
    """
    certain, wanted = (_finite(values) for values in (sure, rather))
    if not len(certain) and not any(map(len, wanted)):
        return None
    low, high = (min(map(np.min, certain)), max(map(np.max, certain))) if certain else (math.inf, -math.inf)
    span = high - low
    lowest, highest = (low - REACH * span, high + REACH * span) if span > 0.0 else (-math.inf, math.inf)
    for values in wanted:
        least, most = np.percentile(values, (LEFT_OUT, 100.0 - LEFT_OUT))
        low, high = min(low, max(least, lowest)), max(high, min(most, highest))
    margin = MARGIN * (high - low)
    return (float(low - margin), float(high + margin)) if 0.0 < margin < math.inf else None


def free_corner(
    lines: Sequence[tuple[np.ndarray, np.ndarray]], axis: tuple[float, float] | None
) -> tuple[Literal["right", "left"], Literal["top", "bottom"]]:
    """The corner of a plot in which a legend hides the least: rather a stretch of noise than an excursion.

    Args:
        lines: Abscissae, (n,), and ordinates, (n,) or (n, n_lines).
        axis: Range of the ordinates; None for what they need.

    Returns:
        Which one.
    """
    drawn = [(x[:, None] if y.ndim == 2 else x, np.nan_to_num(y, posinf=0.0, neginf=0.0)) for x, y in lines if len(x)]
    axis = axis or axis_range([y for _, y in drawn])
    corners = list(product(("right", "left"), ("top", "bottom")))
    if axis is None:
        return corners[0]
    start, end = min(x.min() for x, _ in drawn), max(x.max() for x, _ in drawn)
    drawn = [(x, np.clip(y, *axis)) for x, y in drawn]
    width, height = LEGEND[0] * (end - start), LEGEND[1] * (axis[1] - axis[0])

    def hidden(corner: tuple[str, str]) -> float:
        side, end_of_axis = corner
        loss = 0.0
        for x, y in drawn:
            beside = x > end - width if side == "right" else x < start + width
            within = y > axis[1] - height if end_of_axis == "top" else y < axis[0] + height
            loss += float(np.mean(np.square(y - np.median(y)) * (beside & within)))
        return loss

    return min(corners, key=hidden)


def _finite(arrays: Sequence[np.ndarray]) -> list[np.ndarray]:
    kept = [values[np.isfinite(values)] for values in arrays]
    return [values for values in kept if len(values)]
