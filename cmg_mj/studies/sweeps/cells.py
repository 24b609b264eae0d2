"""The cells of a sweep: every point with every observer, over its worlds. `cells.parquet`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.results.intervals import Interval, finite_mean, known_interval
from cmg_mj.results.summary_keys import KEYS, Figures, Summary
from cmg_mj.studies.sweeps.failure_reasons import Reasons
from cmg_mj.studies.sweeps.study import SweepStudy
from cmg_mj.studies.sweeps.trials import as_table, point_columns

if TYPE_CHECKING:
    import pyarrow as pa

COMPARED = [key for key, about in KEYS.items() if about.compared and about.better and not key.endswith("_fraction")]
"""Figures of which a cell has the mean, and the difference to the best observer's."""
COLUMNS = ["point", "observer", "world", "outcome", "reason", *COMPARED]
"""Columns of the trials that cells are made of."""
BLOCK = 1024
"""Cells whose rows are held together."""


class Trials:
    """The outcomes and figures of a sweep's trials, by cell: 8 bytes a figure.

    Args:
        study: The sweep.
        tables: The trials, in any order and in any number of tables, which are read one after the other.

    Attributes:
        study: The sweep.
        outcome: How each trial ended, (n_points, n_observers, n_worlds).
        stood: Whether each trial stood to the end, (n_points, n_observers, n_worlds).
        reasons: Counts of the reasons why trials were refused or stopped.
    """

    def __init__(self, study: SweepStudy, tables: Iterable[pa.Table]) -> None:
        import pyarrow as pa

        self.study = study
        shape = (len(study.points), len(study.observers), study.worlds)
        self.outcome = np.full(shape, "", dtype=object)
        self._figures = {key: np.full(shape, math.nan) for key in COMPARED}
        self.reasons = Reasons(study.axes[-1].fields[-1])
        place = {name: i for i, name in enumerate(study.observers)}
        for table in tables:
            observers = _texts(table["observer"])
            at = (table["point"].to_numpy(), np.array([place[name] for name in observers]), table["world"].to_numpy())
            outcome = _texts(table["outcome"])
            self.outcome[at] = outcome
            unfinished = (outcome != "done") & (outcome != "fell")
            if unfinished.any():
                reasons = table["reason"].filter(pa.array(unfinished)).to_pylist()
                self.reasons.add(zip(outcome[unfinished], reasons, strict=True))
            for key, values in self._figures.items():
                values[at] = table[key].to_numpy(zero_copy_only=False)
        self.stood = self.outcome == "done"

    @property
    def fell(self) -> np.ndarray:
        """Mask of the trials that fell, (n_points, n_observers, n_worlds). A refused or stopped one did not."""
        return self.outcome == "fell"

    def figure(self, key: str) -> np.ndarray:
        """Return a figure of every trial, (n_points, n_observers, n_worlds); NaN where it did not stand."""
        return np.where(self.stood, self._figures[key], math.nan)


def _texts(column: pa.ChunkedArray) -> np.ndarray:
    """Read a column of few words, each of which is one string object, (n,)."""
    encoded = column.combine_chunks().dictionary_encode()
    return np.array(encoded.dictionary.to_pylist(), dtype=object)[encoded.indices.to_numpy()]


@cache  # of few different counts, at 0.3 ms each
def fell_interval(fell: int, trials: int) -> Interval:
    """Compute the share of falls with Wilson's 95 % interval."""
    from scipy.stats import binomtest

    ends = binomtest(fell, trials).proportion_ci(0.95, method="wilson")
    return Interval(fell / trials, float(ends.low), float(ends.high))


def cells_of(trials: Trials) -> Iterator[Summary]:
    """Make a row a cell, point by point: counts of falls, every figure's mean, and its difference to the best.

    The best observer of a point has the smallest (or largest, where more is better) mean among those that stood in
    every world, baselines apart; differences are taken world by world. The share of falls is among the trials that
    fell or stood; a cell of which all trials were refused or stopped has none.
    """
    fallen = trials.fell
    figures = {key: trials.figure(key) for key in COMPARED}
    for number, point in enumerate(trials.study.points):
        best = {key: _best(values[number], key, trials.study.contenders) for key, values in figures.items()}
        for place, observer in enumerate(trials.study.observers):
            n = trials.study.worlds
            fell, stood = int(fallen[number, place].sum()), int(trials.stood[number, place].sum())
            share = fell_interval(fell, fell + stood) if fell + stood else None
            row: Summary = {"point": number, **point, "observer": observer, "trials": n, "stood": stood}
            row |= {"fell": fell, "stopped": n - stood - fell}
            mean, low, high = share or (None, None, None)
            row |= {"fell_share": mean, "fell_low": low, "fell_high": high}
            for key, values in figures.items():
                row |= _with_ends(key, values[number, place], KEYS[key].positive)
                leader = best[key]
                behind = values[number, place] - (math.nan if leader is None else values[number, leader])
                row |= _with_ends(f"{key}_behind_best", behind)
                row[f"{key}_best"] = None if leader is None else trials.study.observers[leader]
            yield row


def _best(values: np.ndarray, key: str, places: list[int]) -> int | None:
    """Find the best mean among some observers that stood in every world, (n_observers, n_worlds)."""
    means = values[places].mean(axis=1)
    if not np.isfinite(means).any():
        return None
    return places[int(np.nanargmin(means if KEYS[key].better == "less" else -means))]


def _with_ends(key: str, values: np.ndarray, positive: bool = False) -> Figures:
    """Average the known values, with the mean's interval; too few values have none."""
    interval = known_interval(values, positive)
    if interval is not None:
        return {key: interval.mean, f"{key}_low": interval.low, f"{key}_high": interval.high}
    return {key: finite_mean(values), f"{key}_low": None, f"{key}_high": None}


def cells_schema(study: SweepStudy) -> pa.Schema:
    """Declare the columns of `cells_of`."""
    import pyarrow as pa

    counts = [(name, "int64") for name in ("trials", "stood", "fell", "stopped")]
    shares = [(name, "float64") for name in ("fell_share", "fell_low", "fell_high")]
    ends = ("", "_low", "_high")
    figures = [
        column
        for key in COMPARED
        for column in [
            *((f"{name}{end}", "float64") for name in (key, f"{key}_behind_best") for end in ends),
            (f"{key}_best", "string"),
        ]
    ]
    return pa.schema([*point_columns(study), ("observer", "string"), *counts, *shares, *figures])


def cells_in_blocks(trials: Trials) -> Iterator[pa.Table]:
    """Make all cells, some thousand at a time."""
    rows = cells_of(trials)
    while block := list(itertools.islice(rows, BLOCK)):
        yield as_table(block, cells_schema(trials.study))
