"""Cells: every point with every observer, over its worlds. `cells.parquet`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cmg_mj.intervals import Interval, known_interval
from cmg_mj.summary_keys import KEYS
from cmg_mj.sweeps.study import Study

if TYPE_CHECKING:
    import pyarrow as pa

FIGURES = [key for key, of in KEYS.items() if of.compared and of.better and not key.endswith("_fraction")]
"""Of which a cell has the mean, and how far it is behind the best observer's."""


class Trials:
    """The columns of a sweep's trials, by cell.

    Args:
        study: The sweep.
        table: Its trials, in any order.
    """

    def __init__(self, study: Study, table: pa.Table) -> None:
        self.study = study
        place = {name: i for i, name in enumerate(study.observers)}
        points = table["point"].to_numpy()
        observers = np.array([place[name] for name in table["observer"].to_pylist()])
        worlds = table["world"].to_numpy()
        self._shape = (len(study.points), len(study.observers), study.worlds)
        self._order = (points, observers, worlds)
        self._table = table
        self.outcome = self._placed(np.array(table["outcome"].to_pylist(), dtype=object), "")
        self.stood = self.outcome == "done"

    def _placed(self, values: np.ndarray, missing: Any) -> np.ndarray:
        placed = np.full(self._shape, missing, dtype=values.dtype)
        placed[self._order] = values
        return placed

    def figure(self, key: str) -> np.ndarray:
        """A figure of every trial, (n_points, n_observers, n_worlds); NaN where the rig did not stand to the end."""
        values = self._table[key].to_numpy(zero_copy_only=False).astype(float)
        return np.where(self.stood, self._placed(values, math.nan), math.nan)


def fell_interval(fell: int, trials: int) -> Interval:
    """The share of falls with Wilson's 95 % interval."""
    from scipy.stats import binomtest

    found = binomtest(fell, trials).proportion_ci(0.95, method="wilson")
    return Interval(fell / trials, float(found.low), float(found.high))


def cells_of(trials: Trials) -> list[dict[str, Any]]:
    """A row a cell: how many stood and fell, every figure's mean with its interval, and how far it is behind the best.

    The best observer of a point is that of the smallest (or largest, where more is better) mean among those that stood
    in every world; differences are taken world by world.
    """
    figures = {key: trials.figure(key) for key in FIGURES}
    rows = []
    for number, point in enumerate(trials.study.points):
        best = {key: _best(values[number], key) for key, values in figures.items()}
        for place, observer in enumerate(trials.study.observers):
            outcome = trials.outcome[number, place]
            n, fell = len(outcome), int((outcome == "fell").sum())
            stood = int((outcome == "done").sum())
            share = fell_interval(fell, n)
            row: dict[str, Any] = {"point": number, **point, "observer": observer, "trials": n, "stood": stood}
            row |= {"fell": fell, "stopped": n - stood - fell}
            row |= {"fell_share": share.mean, "fell_low": share.low, "fell_high": share.high}
            for key, values in figures.items():
                row |= _with_ends(key, known_interval(values[number, place]))
                leader = best[key]
                behind = None if leader is None else known_interval(values[number, place] - values[number, leader])
                row |= _with_ends(f"{key}_behind_best", behind)
                row[f"{key}_best"] = None if leader is None else trials.study.observers[leader]
            rows.append(row)
    return rows


def _best(values: np.ndarray, key: str) -> int | None:
    """Which observer has the best mean among those that stood in every world, (n_observers, n_worlds)."""
    means = values.mean(axis=1)
    if not np.isfinite(means).any():
        return None
    return int(np.nanargmin(means if KEYS[key].better == "less" else -means))


def _with_ends(key: str, interval: Interval | None) -> dict[str, float | None]:
    if interval is None:
        return {key: None, f"{key}_low": None, f"{key}_high": None}
    return {key: interval.mean, f"{key}_low": interval.low, f"{key}_high": interval.high}


def as_table(rows: Sequence[dict[str, Any]]) -> pa.Table:
    """The rows as a table."""
    import pyarrow as pa

    return pa.Table.from_pylist(list(rows))
