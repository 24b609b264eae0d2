"""A comparison in numbers: means with their 95 % intervals, and differences to the best, world by world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.results.baselines import REFERENCES
from cmg_mj.results.intervals import finite_mean, finite_values, known_interval
from cmg_mj.results.summary_keys import KEYS, Summary, as_table, finite, open_loop_figures, section
from cmg_mj.runs.comparison import ComparedObserver, standard_deviation

if TYPE_CHECKING:
    import pyarrow as pa

PUSH_ERROR, ERROR = "velocity_rms_error_push_rad_s", "velocity_rms_error_rad_s"


@dataclass(frozen=True)
class ComparisonRow:
    """One row of a comparison.

    Attributes:
        entry: An observer in the loop.
        reference: The baseline on that motion, if the row is not the observer's own.
    """

    entry: ComparedObserver
    reference: str | None = None

    @property
    def name(self) -> str:
        """The row's label."""
        return self.reference or self.entry.kind

    def values(self, key: str) -> np.ndarray:
        """Return a figure of every world, (n_worlds,); NaN where a world did not stand or has no such figure."""
        result = self.entry.result
        summary = result.summaries[0]
        figures = open_loop_figures(summary)[self.reference] if self.reference else summary
        return result.values(key, self.reference) if key in figures else np.full(len(result.outcomes), np.nan)

    @property
    def summary(self) -> Summary:
        """Return the means, as `ComparedObserver.summary` does.

        None for what a baseline does not have, since it closes no loop.
        """
        loop = self.entry.summary
        if self.reference is None:
            return loop
        means = {key: finite_mean(self.values(key)) for key in loop if key in KEYS}
        return finite(
            {
                **dict.fromkeys(loop),
                "observer": self.reference,
                "in_loop_of": self.entry.kind,
                "seed": loop["seed"],
                "differs": loop["differs"],
                "worlds": loop["worlds"],
                **means,
                "velocity_rms_error_std_rad_s": standard_deviation(self.values(ERROR)),
            }
        )


def best_observer(compared: Sequence[ComparedObserver], key: str) -> ComparedObserver | None:
    """Find the observer with the best mean of a figure, among those that stood in the most worlds."""
    most = max(entry.result.stood.sum() for entry in compared)
    sign = -1.0 if KEYS[key].better == "more" else 1.0
    candidates = [entry for entry in compared if entry.result.stood.sum() == most]
    means = [(finite_mean(ComparisonRow(entry).values(key)), entry) for entry in candidates]
    known = [(sign * mean, entry) for mean, entry in means if mean is not None]
    return min(known, key=lambda pair: pair[0])[1] if known else None


def comparison_rows(compared: Sequence[ComparedObserver]) -> list[ComparisonRow]:
    """List the rows of a comparison: every observer, then the baselines on the motion of the best of them.

    The best observer is the one with the least error in the push window, or over the whole run if there is no push.
    """
    leader = best_observer(compared, PUSH_ERROR) or best_observer(compared, ERROR)
    known = section(leader.result.summaries[0], "references") if leader else {}
    references = [ComparisonRow(leader, name) for name in REFERENCES if name in known] if leader else []
    return [*map(ComparisonRow, compared), *references]


def standings(compared: Sequence[ComparedObserver]) -> list[Summary]:
    """Compute what `cmg-mj compare --json` prints.

    Args:
        compared: The observers with their runs.

    Returns:
        For each row its means; `intervals`: key -> ends of the mean's 95 % interval; `minus_best`: key -> the
        difference to the best observer in this figure, over the worlds in which both have it, with its interval.
    """
    rows = comparison_rows(compared)
    keys = [key for entry in compared for key in entry.summary if key in KEYS and key in entry.result.summaries[0]]
    keys = list(dict.fromkeys(keys))
    leaders = {
        key: ComparisonRow(leader) for key in keys if KEYS[key].better and (leader := best_observer(compared, key))
    }
    return [
        finite(
            row.summary
            | {
                "intervals": {key: _ends(row.values(key), KEYS[key].positive) for key in keys},
                "minus_best": {
                    key: _paired_difference(row, leader, key) for key, leader in leaders.items() if row != leader
                },
            }
        )
        for row in rows
    ]


def worlds_table(compared: Sequence[ComparedObserver]) -> pa.Table:
    """Make a table of every world of every row of a comparison, as `Result.table` does."""
    return as_table(world for row in comparison_rows(compared) for world in row.entry.result.rows(row.reference))


def _ends(values: np.ndarray, positive: bool = False) -> list[float] | None:
    interval = known_interval(values, positive)
    return None if interval is None else [interval.low, interval.high]


def _paired_difference(row: ComparisonRow, leader: ComparisonRow, key: str) -> Summary:
    """Compare a figure with the best observer's, world by world."""
    differences = row.values(key) - leader.values(key)
    return {
        "best": leader.name,
        "worlds": len(finite_values(differences)),
        "mean": finite_mean(differences),
        "interval": _ends(differences),
    }
