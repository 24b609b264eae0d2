"""Chooses what keeps a figure of many lines legible: the best few lines, the range of an axis, the legend's corner."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Literal

import numpy as np

from cmg_mj.results.summary_keys import SummaryValue
from cmg_mj.visualization.plots.colours import BASELINE_COLOURS

Summary = Mapping[str, SummaryValue]
"""The numbers of a run by the names that `--json` prints."""

FEW = 3
"""Number of observers that a reader can follow over each other."""

RANKING_KEYS = ("velocity_rms_error_push_rad_s", "velocity_rms_error_rad_s")
"""Keys that rank observers: the first one that a summary has. Most of a whole run is stillness."""

CUT_OFF = 0.1
"""Percentage of an estimate's samples, at each end of their range, that an axis may cut off."""

REACH = 3.0
"""An estimate stretches its axis by at most this many spans of the true signal, on each side."""

MARGIN = 0.05

LABEL_POINTS = 21.0
"""Distance between two ticks from which rerun's viewer labels them so that one can read them [points]."""

LABELLED = 2
"""Least number of labelled ticks on an axis."""

TICK_MARGIN = 0.03
"""Room beyond the outermost labelled tick, in steps between ticks."""

FALL_REACH = 1.0
"""A fall stretches an axis by at most this many spans of what came before the fall, on each side."""

LEGEND = (0.35, 0.6)
"""Shares of a plot's width and height that a legend takes."""


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Shorten the names of observers for legends and tables.

    Args:
        names: The observers that one figure or table shows.

    Returns:
        Name -> the class of a dotted path, unless two classes have one name; otherwise the name itself.
    """
    short = [name.rpartition(":")[2] or name for name in names]
    return {name: part if short.count(part) == 1 else name for name, part in zip(names, short, strict=True)}


def figures_by_observer(observers: Sequence[str], summary: Summary) -> dict[str, Summary]:
    """Split a run's numbers by observer.

    Args:
        observers: The observer in the loop, then the open-loop observers.
        summary: The run's numbers; those of open-loop observers are in `open_loop_observers`.

    Returns:
        Observer -> its numbers, in the order of `observers`; empty for an observer without numbers.
    """
    in_loop, *others = observers
    open_loop = section(summary, "open_loop_observers")
    return {in_loop: summary, **{name: section(open_loop, name) for name in others}}


def section(summary: Summary, key: str) -> Summary:
    """Return a part of a summary that has keys of its own; empty if the summary lacks the part."""
    value = summary.get(key)
    return value if isinstance(value, Mapping) else {}


def observers_to_draw(summaries: Mapping[str, Summary], always: Iterable[str] = ()) -> list[str]:
    """Choose the observers to draw when there are too many.

    Args:
        summaries: Observer -> its summary. An observer whose summary has `fell` ranks last.
        always: Observers to draw in any case.

    Returns:
        At most `FEW` names (more only if `always` has more), in the order of `summaries`: those with the smallest
        errors. Baselines are among them only if there are too few observers.
    """
    always = list(always)
    rest = sorted((name for name in summaries if name not in always), key=lambda name: _rank(name, summaries[name]))
    chosen = {*always, *rest[: max(0, FEW - len(always))]}
    return [name for name in summaries if name in chosen]


def _rank(name: str, summary: Summary) -> tuple[bool, bool, float]:
    error = next((value for key in RANKING_KEYS if isinstance(value := summary.get(key), (int, float))), math.inf)
    return name in BASELINE_COLOURS, bool(summary.get("fell")), error if math.isfinite(error) else math.inf


def axis_range(required: Sequence[np.ndarray], optional: Sequence[np.ndarray] = ()) -> tuple[float, float] | None:
    """Choose the range of an axis so that no noisy or diverging line takes all of it.

    Args:
        required: Arrays of any shape that the axis shows whole. Values that are not finite do not count.
        optional: Arrays that the axis shows but for outliers, as far as the required ones keep their room.

    Returns:
        Lowest and highest value, with a margin; None if there is no value, or only one.
    """
    whole, partial = (_finite(arrays) for arrays in (required, optional))
    if not whole and not partial:
        return None
    low, high = (min(map(np.min, whole)), max(map(np.max, whole))) if whole else (math.inf, -math.inf)
    span = high - low
    lowest, highest = (low - REACH * span, high + REACH * span) if span > 0.0 else (-math.inf, math.inf)
    for values in partial:
        least, most = np.percentile(values, (CUT_OFF, 100.0 - CUT_OFF))
        low, high = min(low, max(least, lowest)), max(high, min(most, highest))
    margin = MARGIN * (high - low)
    return (float(low - margin), float(high + margin)) if 0.0 < margin < math.inf else None


def error_range(rates: Sequence[np.ndarray], errors: Sequence[np.ndarray]) -> tuple[float, float] | None:
    """Choose the range of an axis of errors: it shows zero, and spans at least as much as the axis of the rates.

    Args:
        rates: True rates. An error stretches the axis by at most `REACH` of their spans, on each side.
        errors: Errors of the estimates of the rates.

    Returns:
        Lowest and highest value; None if there is no value.
    """
    rate, both, own = axis_range(rates), axis_range(rates, errors), axis_range([], errors)
    if rate is None or both is None:
        return own
    low, high = (max(both[0], min(own[0], 0.0)), min(both[1], max(own[1], 0.0))) if own else (0.0, 0.0)
    more = max(0.0, rate[1] - rate[0] - (high - low)) / 2.0
    return low - more, high + more


def labelled_step(axis: tuple[float, float], height: float) -> float:
    """Return the step between the ticks that a viewer labels: rerun labels multiples of a power of ten.

    Args:
        axis: Range of the axis.
        height: Height of the plot [points].
    """
    return 10.0 ** math.ceil(math.log10((axis[1] - axis[0]) * LABEL_POINTS / height) - 1e-9)


def labelled_ticks(axis: tuple[float, float], height: float) -> list[float]:
    """Return the ticks that a viewer labels on an axis of some height [points]."""
    step = labelled_step(axis, height)
    return [i * step for i in range(math.ceil(axis[0] / step - 1e-9), math.floor(axis[1] / step + 1e-9) + 1)]


def with_scale(axis: tuple[float, float], height: float) -> tuple[float, float]:
    """Widen an axis by as little as makes two of its ticks labelled; one tick alone gives no scale."""
    if len(labelled_ticks(axis, height)) >= LABELLED:
        return axis
    step, (low, high) = labelled_step(axis, height), axis
    first = [math.floor(low / step) + i for i in range(3)]
    more = TICK_MARGIN * step
    ranges = [(min(low, i * step - more), max(high, (i + LABELLED - 1) * step + more)) for i in first]
    return min(ranges, key=lambda ends: ends[1] - ends[0])


def fall_start(time: np.ndarray, tilt: np.ndarray, *, fell: bool) -> float:
    """Find the time from which a run that fell only fell.

    Args:
        time: Times, (n,) [s].
        tilt: True tilt, (n,) [rad].
        fell: Whether the run fell.

    Returns:
        The time from which the tilt's magnitude rises to its last value [s]; infinity for a run that did not fall.
    """
    if not fell or not len(time):
        return math.inf
    is_rising = np.diff(np.abs(tilt)) > 0.0
    others = np.flatnonzero(~is_rising)
    return float(time[others[-1] + 1] if len(others) else time[0])


def stretched(axis: tuple[float, float] | None, after: Sequence[np.ndarray]) -> tuple[float, float] | None:
    """Stretch an axis towards what followed the start of a fall, by at most `FALL_REACH` of its spans on each side.

    Args:
        axis: Result of `axis_range` for what came before the fall.
        after: Arrays of what followed.

    Returns:
        The axis; the range of all that followed, if nothing came before.
    """
    if axis is None:
        return axis_range(after)
    low, high = axis
    reach = FALL_REACH * (high - low)
    for values in _finite(after):
        low, high = min(low, max(axis[0] - reach, values.min())), max(high, min(axis[1] + reach, values.max()))
    return float(low), float(high)


def is_seen(values: np.ndarray, axis: tuple[float, float] | None) -> bool:
    """Judge whether lines, (n,) or (n, n_lines), have any part within an axis; any axis, if it is None."""
    columns = (column[np.isfinite(column)] for column in values.reshape(len(values), -1).T)
    low, high = axis or (-math.inf, math.inf)
    return any(len(column) and column.max() >= low and column.min() <= high for column in columns)


def free_corner(
    lines: Sequence[tuple[np.ndarray, np.ndarray]], axis: tuple[float, float] | None
) -> tuple[Literal["right", "left"], Literal["top", "bottom"]]:
    """Find the corner of a plot in which a legend hides the least; noise counts less than an excursion.

    Args:
        lines: Abscissae, (n,), and ordinates, (n,) or (n, n_lines).
        axis: Range of the ordinates; None to fit them.

    Returns:
        The corner.
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
    finite = (values[np.isfinite(values)] for values in arrays)
    return [values for values in finite if len(values)]
