"""The cells of a sweep: every point with every observer, over its worlds; who leads where. `cells.parquet`."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from cmg_mj.core.errors import shortened
from cmg_mj.features.sweeps.chunks import point_columns, table_of
from cmg_mj.features.sweeps.study import SweepStudy
from cmg_mj.results.intervals import Interval, finite_mean, known_interval
from cmg_mj.results.summary_keys import KEYS, Figures, Summary

MAX_REASON = 240
"""Letters of a reason."""
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?([eE][-+]?\d+)?(?![\w.]*\w)")
COMPARED = [key for key, about in KEYS.items() if about.compared and about.better and not key.endswith("_fraction")]
"""Figures of which a cell has the mean, and the difference to the best observer's."""
COLUMNS = ["point", "observer", "world", "outcome", "reason", *COMPARED]
"""Columns of the trials that cells are made of."""
BLOCK = 1024
"""Cells whose rows are held together."""
CLOSE = 1.2
"""Factor on the leader's error up to which another observer is close to it."""


class Trials:
    """The outcomes and figures of a sweep's trials, by cell: 8 bytes a figure.

    Args:
        study: The sweep.
        tables: The trials, in any order and in any number of tables, which are read one after the other.

    Attributes:
        study: The sweep.
        stood: Mask of the trials that stood to the end, (n_points, n_observers, n_worlds).
        fell: Mask of the trials that fell, likewise. A refused or stopped one did not.
        figures: Figure -> its values, likewise; NaN where a trial did not stand.
        reasons: Outcome and kind of reason -> number of trials that were refused or stopped. Reasons that differ in
            their numbers alone are of one kind, which the first of them stands for.
    """

    def __init__(self, study: SweepStudy, tables: Iterable[pa.Table]) -> None:
        self.study = study
        shape = (study.n_points, len(study.observers), study.worlds)
        self.stood, self.fell = np.zeros((2, *shape), dtype=bool)
        self.figures = {key: np.full(shape, math.nan) for key in COMPARED}
        self.reasons: Counter[tuple[str, str]] = Counter()
        self._first: dict[str, str] = {}
        for table in tables:
            observers = np.array([study.observers.index(name) for name in table["observer"].to_pylist()])
            at = (table["point"].to_numpy(), observers, table["world"].to_numpy())
            outcomes = np.array(table["outcome"].to_pylist())
            self.stood[at], self.fell[at] = outcomes == "done", outcomes == "fell"
            for outcome, reason in zip(outcomes.tolist(), table["reason"].to_pylist(), strict=True):
                if outcome not in ("done", "fell"):
                    self.add_reason(outcome, reason)
            for key, values in self.figures.items():
                values[at] = np.where(outcomes == "done", table[key].to_numpy(zero_copy_only=False), math.nan)

    def add_reason(self, outcome: str, reason: str | None) -> None:
        """Count a trial that neither stood nor fell."""
        text, field = " ".join((reason or "no reason is given").split()), f"{self.study.fields[-1]}="
        if outcome == "refused" and field in text:  # it begins with the values of all fields
            text = text.partition(field)[2].partition(": ")[2] or text
        text = shortened(text, MAX_REASON)
        self.reasons[outcome, self._first.setdefault(NUMBER.sub("#", text), text)] += 1


@cache  # of few different counts, at 0.3 ms each
def fell_interval(fell: int, trials: int) -> Interval:
    """Compute the share of falls with Wilson's 95 % interval."""
    from scipy.stats import binomtest

    ends = binomtest(fell, trials).proportion_ci(0.95, method="wilson")
    return Interval(fell / trials, float(ends.low), float(ends.high))


def fall_shares(trials: Trials) -> np.ndarray:
    """Compute the share of falls among those that fell or stood, and its interval's ends, (n_points, n_observers, 3).

    NaN where all trials of a cell were refused or stopped.
    """
    fell, known = fall_counts(trials)
    counts = zip(fell.ravel().tolist(), known.ravel().tolist(), strict=True)
    rows = [fell_interval(*count) if count[1] else (math.nan,) * 3 for count in counts]
    return np.reshape(rows, (*fell.shape, 3))


def fall_counts(trials: Trials) -> tuple[np.ndarray, np.ndarray]:
    """Count the worlds that fell, and those that fell or stood, (n_points, n_observers) each."""
    return trials.fell.sum(axis=2), (trials.fell | trials.stood).sum(axis=2)


def least(means: np.ndarray, places: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Find the place of the least among some observers, -1 where there is none, (..., n_observers) -> (...) each.

    Returns:
        The place, and the value there; NaN where there is none.
    """
    known = np.full(means.shape, np.inf)
    known[..., places] = np.where(np.isfinite(means), means, np.inf)[..., places]
    value = known.min(axis=-1)
    exists = np.isfinite(value)
    return np.where(exists, known.argmin(axis=-1), -1), np.where(exists, value, np.nan)


def cells_of(trials: Trials) -> Iterator[Summary]:
    """Make a row a cell, point by point: counts of falls, every figure's mean, and its difference to the best.

    The best observer of a point has the smallest (or largest, where more is better) mean among those that stood in
    every world, baselines apart; differences are taken world by world. The share of falls is among the trials that
    fell or stood; a cell of which all trials were refused or stopped has none.
    """
    study, n = trials.study, trials.study.worlds
    n_fell, n_stood = trials.fell.sum(axis=2), trials.stood.sum(axis=2)
    best = {}
    for key, values in trials.figures.items():
        means = values.mean(axis=-1)
        best[key], _ = least(means if KEYS[key].better == "less" else -means, study.contenders)
    for number, (place, observer) in itertools.product(range(study.n_points), enumerate(study.observers)):
        fell, stood = int(n_fell[number, place]), int(n_stood[number, place])
        share, low, high = fell_interval(fell, fell + stood) if fell + stood else (None, None, None)
        row: Summary = {"point": number, **study.point(number), "observer": observer, "trials": n, "stood": stood}
        row |= {"fell": fell, "stopped": n - stood - fell, "fell_share": share, "fell_low": low, "fell_high": high}
        for key, values in trials.figures.items():
            leader = int(best[key][number])
            behind = values[number, place] - (math.nan if leader < 0 else values[number, leader])
            row |= with_ends(key, values[number, place], KEYS[key].positive)
            row |= with_ends(f"{key}_behind_best", behind)
            row[f"{key}_best"] = None if leader < 0 else study.observers[leader]
        yield row


def with_ends(key: str, values: np.ndarray, positive: bool = False) -> Figures:
    """Average the known values, with the mean's interval; too few values have none."""
    _, low, high = known_interval(values, positive) or (None, None, None)
    return {key: finite_mean(values), f"{key}_low": low, f"{key}_high": high}


def cells_schema(study: SweepStudy) -> pa.Schema:
    """Declare the columns of `cells_of`."""
    columns = [*point_columns(study), ("observer", "string")]
    columns += [(name, "int64") for name in ("trials", "stood", "fell", "stopped")]
    columns += [(name, "float64") for name in ("fell_share", "fell_low", "fell_high")]
    for key in COMPARED:
        for name in (key, f"{key}_behind_best"):
            columns += [(f"{name}{end}", "float64") for end in ("", "_low", "_high")]
        columns.append((f"{key}_best", "string"))
    return pa.schema(columns)


def cells_in_blocks(trials: Trials) -> Iterator[pa.Table]:
    """Make all cells, some thousand at a time."""
    rows = cells_of(trials)
    while block := list(itertools.islice(rows, BLOCK)):
        yield table_of(block, cells_schema(trials.study))


# --- who leads


class LeadRow(NamedTuple):
    """Numbers of points at which an observer leads, or a baseline is ahead of the leader.

    Attributes:
        name: The observer, or the baseline.
        is_baseline: Whether it closes no loop.
        leads: Points at which it leads; of a baseline, at which its error is less than the leader's.
        surely: Points at which it does so beyond 95 % intervals.
        close: Points at which it stood in every world, with at most `CLOSE` times the leader's error.
    """

    name: str
    is_baseline: bool
    leads: int
    surely: int
    close: int


def least_error(figure: np.ndarray, places: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the best mean among those that stood in every world, (..., n_observers, n_worlds) -> (...) each.

    The best is sure if its mean difference to every other, world by world, is beyond its 95 % interval.

    Args:
        figure: The error of every trial; NaN where it did not stand.
        places: The observers that are compared.

    Returns:
        Place of the best, -1 where there is none; whether it is sure; its mean.
    """
    means = figure.mean(axis=-1)
    best, value = least(means, places)
    sure = np.zeros(best.shape, dtype=bool)
    for at in zip(*np.nonzero(best >= 0), strict=True):
        others = [place for place in places if place != best[at] and np.isfinite(means[at][place])]
        sure[at] = all(_is_less(figure[at][best[at]], figure[at][place]) for place in others)
    return best, sure, value


def _is_less(values: np.ndarray, others: np.ndarray) -> bool:
    """Judge whether values are less than others beyond the 95 % interval of the mean difference, (n_worlds,) each."""
    behind = known_interval(others - values)
    return behind is not None and behind.low > 0.0


def baselines_ahead(study: SweepStudy, figure: np.ndarray, best_error: np.ndarray) -> dict[str, np.ndarray]:
    """Compare baselines with the leader, (..., n_observers, n_worlds) and (...) -> baseline -> (...).

    Returns:
        Shares above one half where the baseline has the lesser error: the leader's by the sum of both. One where nobody
        leads. NaN where the baseline has no error, because the true rate does not keep the rig up.
    """
    shares = {}
    for name in study.references:
        mean = figure[..., study.observers.index(name), :].mean(axis=-1)
        shares[name] = np.where(np.isnan(best_error) & np.isfinite(mean), 1.0, best_error / (best_error + mean))
    return shares


def lead_rows(trials: Trials, key: str) -> list[LeadRow]:
    """Count the points at which each observer leads, and each baseline is ahead.

    Args:
        trials: The trials.
        key: The figure, less of which is better.

    Returns:
        A row an observer, then a row a baseline.
    """
    study = trials.study
    figure = trials.figures[key]
    best, sure, error = least_error(figure, study.contenders)
    ahead = baselines_ahead(study, figure, error)
    rows = []
    for place, name in enumerate(study.observers):
        errors = figure[:, place]
        leads, surely = best == place, (best == place) & sure
        if name in ahead:
            leads = ahead[name] > 0.5
            against = zip(leads, errors, figure, best, strict=True)
            surely = [leads_here and (i < 0 or _is_less(own, all_[i])) for leads_here, own, all_, i in against]
        close = errors.mean(axis=-1) <= CLOSE * error
        counts = (int(np.sum(mask)) for mask in (leads, surely, close))
        rows.append(LeadRow(name, name in ahead, *counts))
    return sorted(rows, key=lambda row: row.is_baseline)
