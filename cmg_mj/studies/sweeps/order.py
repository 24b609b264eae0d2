"""Whether a named order of observers holds: each with a smaller error than the next. `order.parquet`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cmg_mj.results.intervals import Interval
from cmg_mj.studies.sweeps.cells import Trials, fell_interval
from cmg_mj.studies.sweeps.study import SweepStudy
from cmg_mj.studies.sweeps.trials import as_table, point_columns

if TYPE_CHECKING:
    import pyarrow as pa

JUDGED = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s", "tilt_rms_deg")
"""Figures that an order is counted by, where a trial has them; each is better when it is less."""


class OrderCount(NamedTuple):
    """How often an order held.

    Attributes:
        times: So often.
        of: Of so many that can tell.
    """

    times: int
    of: int

    @property
    def share(self) -> Interval | None:
        """With Wilson's 95 % interval; None of nothing."""
        return fell_interval(self.times, self.of) if self.of else None


def figures_of(trials: Trials) -> list[str]:
    """Those of JUDGED that the trials have."""
    return [key for key in JUDGED if np.isfinite(trials.figure(key)).any()] or [JUDGED[0]]


def order_at(trials: Trials, key: str) -> list[OrderCount]:
    """In how many of each point's worlds the study's order holds.

    Args:
        trials: The trials.
        key: The figure that decides. A fall is worse than any.

    Returns:
        A point each. A world in which two next to each other fell cannot tell, unless the others break the order;
        nor can one in which a trial was refused or stopped, whatever the others are: that is no merit of theirs.
    """
    return [_held(values) for values in _errors(trials, key, trials.study.order)]


def order_of_points(trials: Trials, key: str, order: Sequence[str]) -> OrderCount:
    """At how many points it holds for the means over the worlds.

    One that fell in some world is worse than any mean; a point with a trial that was refused or stopped cannot tell.
    """
    return _held(_errors(trials, key, order).mean(axis=2).T)


def pairs_of(order: Sequence[str]) -> list[tuple[str, str]]:
    """The comparisons that an order is made of."""
    return list(pairwise(order))


def log_ratio(trials: Trials, key: str, better: str, worse: str) -> np.ndarray:
    """Logarithm of one observer's figure by another's, (n_points, n_worlds); NaN where one did not stand."""
    places = [trials.study.observers.index(name) for name in (better, worse)]
    first, second = np.moveaxis(trials.figure(key)[:, places], 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(first / second)


def _errors(trials: Trials, key: str, order: Sequence[str]) -> np.ndarray:
    """Of an order's observers, (n_points, n_order, n_worlds); infinite where one fell, NaN where nothing is known."""
    places = [trials.study.observers.index(name) for name in order]
    return np.where(trials.fell[:, places], np.inf, trials.figure(key)[:, places])


def _held(errors: np.ndarray) -> OrderCount:
    """Of errors (n_order, n); those with a NaN cannot tell."""
    errors = errors[:, ~np.isnan(errors).any(axis=0)]
    better, worse = errors[:-1], errors[1:]
    holds = (better < worse).all(axis=0)
    broken = ((better >= worse) & np.isfinite(worse)).any(axis=0)
    return OrderCount(int(holds.sum()), int((holds | broken).sum()))


def order_table(study: SweepStudy, rows: Sequence[dict[str, Any]]) -> pa.Table:
    """The rows of `order_rows` as a table."""
    import pyarrow as pa

    ends = [(name, "float64") for name in ("share", "low", "high")]
    columns = [
        ("figure", "string"),
        *point_columns(study),
        ("order", "string"),
        ("held", "int64"),
        ("worlds", "int64"),
        *ends,
    ]
    return as_table(rows, pa.schema(columns))


def order_rows(trials: Trials) -> list[dict[str, Any]]:
    """A row a figure and point: in how many worlds the order held, of how many, and the share with its interval."""
    rows = []
    for key in figures_of(trials):
        for number, (point, held) in enumerate(zip(trials.study.points, order_at(trials, key), strict=True)):
            share = held.share
            low, high = (None, None) if share is None else (share.low, share.high)
            row = {"figure": key, "point": number, **point, "order": ",".join(trials.study.order)}
            row |= {"held": held.times, "worlds": held.of, "share": None if share is None else share.mean}
            rows.append(row | {"low": low, "high": high})
    return rows


def by_quarters(trials: Trials, key: str) -> list[tuple[str, float, float, OrderCount]]:
    """How often the order holds where a field is low, and where it is high.

    Args:
        trials: The trials of a sampled design.
        key: The figure that decides.

    Returns:
        Of each quarter of a field's range, and of each number in a list: the field, the lowest and the highest value,
        and at how many of the points there it holds for the means over the worlds.
    """
    errors = _errors(trials, key, trials.study.order).mean(axis=2)
    found = []
    for axis in trials.study.axes:
        values = np.array([point[axis.field] for point in trials.study.points])
        if np.issubdtype(values.dtype, np.number):
            groups = values if axis.values else np.digitize(values, np.quantile(values, (0.25, 0.5, 0.75)))
            for group in np.unique(groups):
                there = values[groups == group]
                found.append((axis.field, there.min().item(), there.max().item(), _held(errors[groups == group].T)))
    return found
