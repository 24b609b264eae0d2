"""The leader at a point of a sweep: the observer of the least error, and the baselines that have less."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cmg_mj.results.intervals import known_interval
from cmg_mj.studies.sweeps.cells import Trials
from cmg_mj.studies.sweeps.order import OrderCount
from cmg_mj.studies.sweeps.study import SweepStudy

CLOSE = 1.2
"""Factor on the leader's error up to which another observer is close to it."""


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
    leads: OrderCount
    surely: OrderCount
    close: OrderCount


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
    contenders = study.contenders
    best, sure, least = least_error(figure, contenders)
    ahead = baselines_ahead(study, figure, least)
    rows = []
    for place, name in enumerate(study.observers):
        errors = figure[:, place]
        is_baseline = name in ahead
        if is_baseline:
            leads = ahead[name] > 0.5
            leaders = [figure[i, best[i]] for i in range(len(figure))]
            pairs = zip(leads, best, errors, leaders, strict=True)
            surely = np.array([bool(lead) and (b < 0 or _is_less(own, other)) for lead, b, own, other in pairs])
        else:
            leads = best == place
            surely = leads & sure
        close = errors.mean(axis=-1) <= CLOSE * least
        counts = (OrderCount(int(mask.sum()), len(figure)) for mask in (leads, surely, close))
        rows.append(LeadRow(name, is_baseline, *counts))
    return sorted(rows, key=lambda row: row.is_baseline)
