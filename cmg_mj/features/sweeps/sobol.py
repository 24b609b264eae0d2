"""Sobol indices of a sweep: the fields that an observer's figures depend on. `indices.parquet`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa

from cmg_mj.features.sweeps.cells import COMPARED, Trials
from cmg_mj.features.sweeps.chunks import table_of
from cmg_mj.results.intervals import CONFIDENCE

RESAMPLES = 999
MIN_ROWS = 16
"""Rows of a design by whose intervals anything is called decisive: those of fewer are too narrow."""
LOST = "lost_share"
"""Quantity that is decomposed besides the figures: the share of worlds that fell or stopped."""
MAX_HELD = 2_000_000
"""Values of resamples held together."""


IndexRow: TypeAlias = dict[str, Any]
"""A row of `indices.parquet`: the indices of a figure, observer and field, or why there are none."""


class Indices(NamedTuple):
    """Shares of a variance, with the ends of their 95 % intervals; each (n_fields,).

    Attributes:
        first: Share that a field explains by itself.
        first_low: Its interval's lower end.
        first_high: Its interval's upper end.
        total: Share that a field explains together with all that it acts with.
        total_low: Its interval's lower end.
        total_high: Its interval's upper end.
    """

    first: np.ndarray
    first_low: np.ndarray
    first_high: np.ndarray
    total: np.ndarray
    total_low: np.ndarray
    total_high: np.ndarray

    @property
    def decisive(self) -> np.ndarray:
        """True for each field whose total index's interval lies above that of every other field, (n_fields,)."""
        others = np.array([np.delete(self.total_high, i).max(initial=-np.inf) for i in range(len(self.total))])
        return (self.total_low > others) & (len(self.total) > 1)


def indices(values: np.ndarray, n: int, seed: int) -> Indices:
    """Compute first-order and total indices of a function at the points of a design for them.

    S_i = mean(f_B (f_AB_i - f_A)) / var, ST_i = mean((f_A - f_AB_i)^2) / (2 var) (`scipy.stats.sobol_indices`).
    Intervals: percentiles of resampled rows of the design, by a seed so that they come out the same again.

    Args:
        values: At A, B, and A with each column in turn from B, (n (n_fields + 2),); finite, and not all the same.
        n: Rows of the design.
        seed: Seed of the resampling.

    Returns:
        The indices with their intervals.
    """
    blocks = values.reshape(-1, n)
    first, total = _estimated(blocks, np.arange(n)[None])
    rng = np.random.default_rng(seed)
    size = max(1, MAX_HELD // len(values))
    pieces = [min(size, RESAMPLES - done) for done in range(0, RESAMPLES, size)]
    resampled = [_estimated(blocks, rng.integers(n, size=(piece, n))) for piece in pieces]
    tail = (1.0 - CONFIDENCE) / 2.0
    firsts, totals = (np.concatenate(part) for part in zip(*resampled, strict=True))
    first_low, first_high = np.quantile(firsts, (tail, 1.0 - tail), axis=0)
    total_low, total_high = np.quantile(totals, (tail, 1.0 - tail), axis=0)
    return Indices(first[0], first_low, first_high, total[0], total_low, total_high)


def _estimated(blocks: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimate both indices by some rows of the design, (n_resamples, n) -> (n_resamples, n_fields) each."""
    from scipy.stats import sobol_indices  # half a second

    f = blocks[:, rows]
    result = sobol_indices(func={"f_A": f[0], "f_B": f[1], "f_AB": f[2:]}, n=rows.shape[1])
    return np.atleast_2d(result.first_order), np.atleast_2d(result.total_order)


def index_table(rows: Sequence[IndexRow]) -> pa.Table:
    """Make the rows of `index_rows` into a table."""
    names = [(name, "string") for name in ("figure", "observer", "field")]
    figures = [(name, "float64") for name in Indices._fields]
    return table_of(rows, pa.schema([*names, *figures, ("decisive", "bool"), ("refused", "string")]))


def index_rows(trials: Trials) -> list[IndexRow]:
    """Make a row for each quantity, observer and field; without indices, and with the reason, where there are none.

    The indices decompose the mean over a point's worlds, whose noise is the same at every point.
    """
    study = trials.study
    rows: list[IndexRow] = []
    for figure, observer, values, outcome in _quantities(trials):
        refused = _refused(values, outcome, study.n)
        result = None if refused else indices(values.mean(axis=1), study.n, study.scenario.seed)
        for i, axis in enumerate(study.axes):
            row: IndexRow = {"figure": figure, "observer": observer, "field": axis.field}
            row |= {name: result and float(getattr(result, name)[i]) for name in Indices._fields}
            decisive = result and bool(result.decisive[i]) and study.n >= MIN_ROWS
            rows.append(row | {"decisive": decisive, "refused": refused})
    return rows


def _quantities(trials: Trials) -> Iterator[tuple[str, str, np.ndarray, np.ndarray]]:
    """List what is decomposed: name, observer, values and outcomes, (n_points, n_worlds) each.

    Quantities are every observer's figures, and how often it did not stand.
    """
    observers = trials.study.observers
    for key in COMPARED:
        values = trials.figure(key)
        if np.isfinite(values).any() or not trials.stood.any():  # not an error in the window of no push
            for place, observer in enumerate(observers):
                yield key, observer, values[:, place], trials.outcome[:, place]
    for place, observer in enumerate(observers):
        lost = ~trials.stood[:, place]
        yield LOST, observer, lost.astype(float), np.full(lost.shape, "done", dtype=object)


def _refused(values: np.ndarray, outcome: np.ndarray, n: int) -> str | None:
    """Say why a quantity of a design of n rows has no indices, with counts; None if it has."""
    means = values.mean(axis=1)
    unknown = ~np.isfinite(values)
    if unknown.any():
        ends = [
            {"done": "have no such figure", "fell": "fell"}.get(end, "stopped") for end in outcome[unknown].tolist()
        ]
        counts = ", ".join(f"{count} {end}" for end, count in sorted(Counter(ends).items()))
        points = f"{unknown.any(axis=1).sum()} of {len(means)} points"
        return f"no value at {points}: of {values.size} trials {counts}"
    if np.ptp(means) == 0.0:
        return "the same at every point"
    independent = 2 * n  # A and B, of which the variance is taken
    if np.ptp(means[:independent]) == 0.0:
        return (
            f"the same at all {independent} independent points of the design: no variance to share out; take more rows"
        )
    return None
