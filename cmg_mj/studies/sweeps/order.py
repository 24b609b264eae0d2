"""Counts how often a named order of observers holds: each with a smaller error than the next. `order.parquet`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmg_mj.results.intervals import Interval
from cmg_mj.results.summary_keys import Summary
from cmg_mj.studies.sweeps.cells import Trials, fell_interval
from cmg_mj.studies.sweeps.study import SweepStudy
from cmg_mj.studies.sweeps.trials import as_table, point_columns

if TYPE_CHECKING:
    import pyarrow as pa

ORDER_FIGURES = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s", "tilt_rms_deg")
"""Figures that an order is counted by, where a trial has them; each is better when it is less."""


class OrderCount(NamedTuple):
    """Count of how often an order held.

    Attributes:
        held: Number of worlds, or points, in which the order held.
        decided: Number of worlds, or points, that can tell.
    """

    held: int
    decided: int

    @property
    def share(self) -> Interval | None:
        """The share with Wilson's 95 % interval; None of nothing."""
        return fell_interval(self.held, self.decided) if self.decided else None

    @property
    def words(self) -> str:
        """Both numbers, as tables show them."""
        return f"{self.held} of {self.decided}"


def figures_of(trials: Trials) -> list[str]:
    """List the figures of ORDER_FIGURES that the trials have."""
    return [key for key in ORDER_FIGURES if np.isfinite(trials.figure(key)).any()] or [ORDER_FIGURES[0]]


def order_counts(trials: Trials) -> dict[str, list[OrderCount]]:
    """Count, for each figure and point, the worlds in which the study's order holds.

    A fall is worse than any error. A world in which two next to each other fell cannot tell, unless the others break
    the order. Nor can a world in which a trial was refused or stopped, whatever the others are: that is no merit of
    theirs.

    Args:
        trials: The trials.

    Returns:
        Figure that decides -> a count for each point.
    """
    order = trials.study.order
    return {key: [_count(values) for values in _errors(trials, key, order)] for key in figures_of(trials)}


def order_of_points(trials: Trials, key: str, order: Sequence[str]) -> OrderCount:
    """Count the points at which an order holds for the means over the worlds.

    A fall in some world is worse than any mean; a point with a trial that was refused or stopped cannot tell.
    """
    return _count(_errors(trials, key, order).mean(axis=2).T)


def pairs_of(order: Sequence[str]) -> list[tuple[str, str]]:
    """List the comparisons that an order is made of."""
    return list(pairwise(order))


def log_ratio(trials: Trials, key: str, better: str, worse: str) -> np.ndarray:
    """Compute the logarithm of two observers' ratio, (n_points, n_worlds); NaN where one did not stand."""
    places = [trials.study.observers.index(name) for name in (better, worse)]
    first, second = np.moveaxis(trials.figure(key)[:, places], 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(first / second)


def _errors(trials: Trials, key: str, order: Sequence[str]) -> np.ndarray:
    """Stack the errors of an order's observers, (n_points, n_order, n_worlds); infinite where one fell, or NaN."""
    places = [trials.study.observers.index(name) for name in order]
    return np.where(trials.fell[:, places], np.inf, trials.figure(key)[:, places])


def _count(errors: np.ndarray) -> OrderCount:
    """Count the columns of errors (n_order, n) in which the order holds; those with a NaN cannot tell."""
    errors = errors[:, ~np.isnan(errors).any(axis=0)]
    better, worse = errors[:-1], errors[1:]
    holds = (better < worse).all(axis=0)
    broken = ((better >= worse) & np.isfinite(worse)).any(axis=0)
    return OrderCount(int(holds.sum()), int((holds | broken).sum()))


def order_table(study: SweepStudy, counts: Mapping[str, Sequence[OrderCount]]) -> pa.Table:
    """Make a table of `order_rows`."""
    import pyarrow as pa

    numbers = [("order", "string"), ("held", "int64"), ("worlds", "int64")]
    ends = [(name, "float64") for name in ("share", "low", "high")]
    schema = pa.schema([("figure", "string"), *point_columns(study), *numbers, *ends])
    return as_table(order_rows(study, counts), schema)


def order_rows(study: SweepStudy, counts: Mapping[str, Sequence[OrderCount]]) -> list[Summary]:
    """Make a row for each figure and point: in how many worlds the order held, and the share with its interval."""
    rows: list[Summary] = []
    for key, points in counts.items():
        for number, (point, count) in enumerate(zip(study.points, points, strict=True)):
            share, low, high = count.share or (None, None, None)
            row: Summary = {"figure": key, "point": number, **point, "order": ",".join(study.order)}
            row |= {"held": count.held, "worlds": count.decided, "share": share, "low": low, "high": high}
            rows.append(row)
    return rows


def by_quarters(trials: Trials, key: str) -> list[tuple[str, float, float, OrderCount]]:
    """Count how often the order holds where a field is low, and where it is high.

    Args:
        trials: The trials of a sampled design.
        key: The figure that decides.

    Returns:
        For each quarter of a field's range, and each number in a list: the field, the lowest and the highest value,
        and at how many of the points there the order holds for the means over the worlds.
    """
    errors = _errors(trials, key, trials.study.order).mean(axis=2)
    quarters = []
    for axis in trials.study.axes:
        values = np.array([point[axis.field] for point in trials.study.points])
        if np.issubdtype(values.dtype, np.number):
            groups = values if axis.values else np.digitize(values, np.quantile(values, (0.25, 0.5, 0.75)))
            for group in np.unique(groups):
                members = values[groups == group]
                count = _count(errors[groups == group].T)
                quarters.append((axis.field, members.min().item(), members.max().item(), count))
    return quarters
