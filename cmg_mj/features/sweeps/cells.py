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
from cmg_mj.features.sweeps.chunks import as_table, point_columns
from cmg_mj.features.sweeps.study import SweepStudy
from cmg_mj.results.intervals import Interval, finite_mean, known_interval
from cmg_mj.results.summary_keys import KEYS, Figures, Summary

LONGEST = 240
"""Most letters of a reason."""
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?([eE][-+]?\d+)?(?![\w.]*\w)")


class Reasons:
    """Counts of the reasons why trials never ran to an end.

    Reasons that differ in their numbers alone are of one kind, which the first of them stands for.

    Args:
        field: The last varied field: a refusal begins with the values of all, which are discarded.
    """

    def __init__(self, field: str) -> None:
        self._field = field
        self.counts: Counter[tuple[str, str]] = Counter()
        self._first: dict[tuple[str, str], str] = {}
        self._differ: set[tuple[str, str]] = set()

    def add(self, ended: Iterable[tuple[str, str | None]]) -> None:
        """Count trials that neither stood nor fell: outcome and reason of each."""
        for (outcome, reason), n in Counter(ended).items():
            text = " ".join((reason or "no reason is given").split())
            if outcome == "refused" and f"{self._field}=" in text:
                text = text.partition(f"{self._field}=")[2].partition(": ")[2] or text
            text = shortened(text, LONGEST)
            kind = (outcome, NUMBER.sub("#", text))
            if self._first.setdefault(kind, text) != text:
                self._differ.add(kind)
            self.counts[kind] += n

    def most(self, n: int) -> list[str]:
        """List the most frequent kinds of reasons, with counts."""
        return [
            f"{count} {kind[0]}{', such as' if kind in self._differ else ''}: {self._first[kind]}"
            for kind, count in self.counts.most_common(n)
        ]


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
    counts = [(name, "int64") for name in ("trials", "stood", "fell", "stopped")]
    shares = [(name, "float64") for name in ("fell_share", "fell_low", "fell_high")]
    figures: list[tuple[str, str]] = []
    for key in COMPARED:
        figures += [
            (f"{name}{end}", "float64") for name in (key, f"{key}_behind_best") for end in ("", "_low", "_high")
        ]
        figures.append((f"{key}_best", "string"))
    return pa.schema([*point_columns(study), ("observer", "string"), *counts, *shares, *figures])


def cells_in_blocks(trials: Trials) -> Iterator[pa.Table]:
    """Make all cells, some thousand at a time."""
    rows = cells_of(trials)
    while block := list(itertools.islice(rows, BLOCK)):
        yield as_table(block, cells_schema(trials.study))


CLOSE = 1.2
"""Factor on the leader's error up to which another observer is close to it."""


class Count(NamedTuple):
    """Numbers of points or worlds: those counted, and all that can tell."""

    held: int
    of: int

    @property
    def share(self) -> Interval | None:
        """The share with Wilson's 95 % interval; None of nothing."""
        return fell_interval(self.held, self.of) if self.of else None

    @property
    def words(self) -> str:
        """Both numbers, as tables show them."""
        return f"{self.held} of {self.of}"


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
    leads: Count
    surely: Count
    close: Count


def least_error(figure: np.ndarray, places: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the best mean among those that stood in every world, (..., n_observers, n_worlds) -> (...) each.

    The best is sure if its mean difference to every other, world by world, is beyond its 95 % interval.

    Args:
        figure: The error of every trial; NaN where it did not stand.
        places: The observers that are compared.

    Returns:
        Place of the best, -1 where there is none; whether it is sure; its mean.
    """
    means = np.full(figure.shape[:-1], np.nan)
    means[..., places] = figure[..., places, :].mean(axis=-1)
    best, least = smallest(means)
    sure = np.zeros(best.shape, dtype=bool)
    for at in zip(*np.nonzero(best >= 0), strict=True):
        others = [i for i in np.nonzero(np.isfinite(means[at]))[0] if i != best[at]]
        sure[at] = all(_is_less(figure[at][best[at]], figure[at][i]) for i in others)
    return best, sure, least


def _is_less(values: np.ndarray, others: np.ndarray) -> bool:
    """Judge whether values are less than others beyond the 95 % interval of the mean difference, (n_worlds,) each."""
    behind = known_interval(others - values)
    return behind is not None and behind.low > 0.0


def smallest(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the place of the smallest along the last axis, -1 where there is none, and its value."""
    filled = np.where(np.isfinite(values), values, np.inf)
    least = filled.min(axis=-1)
    return np.where(np.isfinite(least), filled.argmin(axis=-1), -1), np.where(np.isfinite(least), least, np.nan)


def baselines_ahead(study: SweepStudy, figure: np.ndarray, least: np.ndarray) -> dict[str, np.ndarray]:
    """Compare baselines with the leader, (..., n_observers, n_worlds) and (...) -> baseline -> (...).

    Returns:
        Shares above one half where the baseline has the lesser error: the leader's by the sum of both. One where nobody
        leads. NaN where the baseline has no error, because the true rate does not keep the rig up.
    """
    shares = {}
    for name in study.references:
        mean = figure[..., study.observers.index(name), :].mean(axis=-1)
        shares[name] = np.where(np.isnan(least) & np.isfinite(mean), 1.0, least / (least + mean))
    return shares


def lead_rows(trials: Trials, key: str) -> list[LeadRow]:
    """Count the points at which each observer leads, and each baseline is ahead.

    Args:
        trials: The trials. In a design for indices the rows A and B count, whose points are independent.
        key: The figure, less of which is better.

    Returns:
        A row an observer, then a row a baseline.
    """
    study = trials.study
    figure = trials.figure(key)
    if study.design == "sobol":
        figure = figure[: 2 * study.n]
    best, sure, least = least_error(figure, study.contenders)
    ahead = baselines_ahead(study, figure, least)
    rows = []
    for place, name in enumerate(study.observers):
        errors = figure[:, place]
        leads, surely = best == place, (best == place) & sure
        if name in ahead:
            leads = ahead[name] > 0.5
            surely = [
                bool(leads[i]) and (best[i] < 0 or _is_less(errors[i], figure[i, best[i]])) for i in range(len(best))
            ]
        close = errors.mean(axis=-1) <= CLOSE * least
        counts = (Count(int(np.sum(mask)), len(figure)) for mask in (leads, surely, close))
        rows.append(LeadRow(name, name in ahead, *counts))
    return sorted(rows, key=lambda row: row.is_baseline)
