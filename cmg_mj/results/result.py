"""Outcomes and figures of the worlds of a run."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.results.summary_keys import NESTED, Summary, as_table, open_loop_figures
from cmg_mj.results.trajectory import NamedColumns, Trajectory, frame_of

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa


@dataclass
class Outcome:
    """The end of one world.

    Attributes:
        kind: `done`, `fell`, `stopped` (observer or plant failed) or `interrupted`.
        time_s: When [s].
        reason: In words, for `stopped`.
        with_others: Whether what stopped it stopped all worlds of its batch that still ran: it may be another's fault.
    """

    kind: Literal["done", "fell", "stopped", "interrupted"]
    time_s: float
    reason: str = ""
    with_others: bool = False

    @property
    def fell(self) -> bool:
        """Return whether the plant fell."""
        return self.kind == "fell"


@dataclass
class Result(NamedColumns):
    """The outcome, the numbers and perhaps the trajectory of a run's worlds.

    It has the columns of `table()`, a row per observer and world: `result["stood"]`, `dict(result)`.

    Attributes:
        outcomes: How each world ended, (n_worlds,).
        summaries: Each world's numbers, (n_worlds,).
        trajectory: All ticks, if they were kept.
        observers: The observer in the loop, then the open-loop observers.
        seed: Seed of the sensors' noise.
        world_ids: The worlds' numbers, (n_worlds,).
        driver: Who called the controller, or was it.
    """

    outcomes: list[Outcome]
    summaries: list[Summary]
    trajectory: Trajectory | None = None
    observers: Sequence[str] = ("",)
    seed: int = 0
    world_ids: Sequence[int] = ()
    driver: str = "native"

    @property
    def seconds(self) -> float:
        """Simulated time of the longest world [s]."""
        return max(outcome.time_s for outcome in self.outcomes)

    @property
    def stood(self) -> np.ndarray:
        """True for each world that stood to the end, (n_worlds,)."""
        return np.array([outcome.kind == "done" for outcome in self.outcomes])

    @property
    def fell(self) -> np.ndarray:
        """True for each world that fell, (n_worlds,)."""
        return np.array([outcome.fell for outcome in self.outcomes])

    @property
    def interrupted(self) -> bool:
        """True if the user interrupted the run."""
        return any(outcome.kind == "interrupted" for outcome in self.outcomes)

    def values(self, key: str, estimator: str | None = None) -> np.ndarray:
        """Return one number of every world's summary.

        Args:
            key: The summary's key, such as `velocity_rms_error_rad_s`.
            estimator: An open-loop observer or a baseline (`zero`, `mems_gyro`); None for the observer in the loop.

        Returns:
            (n_worlds,); NaN for a world that did not stand to the end, or has no such number.

        Raises:
            InputError: There is no such key or estimator.
        """
        others = self._open_loop_names
        if estimator is not None and estimator not in others:
            raise InputError(f"{estimator!r}: no open-loop observer of this run; {nearest(estimator, others)}")
        known = {name for summary in self._summaries(estimator) for name in summary}
        if key not in known:
            raise InputError(f"{key!r}: not in the summary; {nearest(key, known)}")
        return np.where(self.stood, self.until_end(key, estimator), math.nan)

    def until_end(self, key: str, estimator: str | None = None) -> np.ndarray:
        """Return what `values` does, but of every world until its end, and NaN where there is no such number."""
        return np.array([summary.get(key) for summary in self._summaries(estimator)], dtype=float)  # None becomes NaN

    def _summaries(self, estimator: str | None) -> Sequence[Summary]:
        """Return the numbers of one estimator in every world; none in a world that lacks a floor."""
        if estimator is None:
            return self.summaries
        return [{**open_loop_figures(summary).get(estimator, {})} for summary in self.summaries]

    def mean(self, key: str, estimator: str | None = None) -> float | None:
        """Return the mean of `values` over the worlds that have one; None if no world has."""
        known = [value for value in self.values(key, estimator) if math.isfinite(value)]
        return statistics.fmean(known) if known else None

    @property
    def _open_loop_names(self) -> list[str]:
        """Names of the open-loop observers, then of the baselines; a world may lack a floor."""
        return list(dict.fromkeys(name for summary in self.summaries for name in open_loop_figures(summary)))

    def rows(self, estimator: str | None = None) -> list[Summary]:
        """Make the rows of `table` of one estimator.

        Args:
            estimator: An open-loop observer or a baseline; None for the observer in the loop.

        Returns:
            A row a world, by column.
        """
        loop = self.observers[0]
        worlds = self.world_ids or range(len(self.outcomes))
        return [
            {
                "observer": estimator or loop,
                "in_loop_of": loop if estimator else None,
                "world": world,
                "seed": self.seed,
                "outcome": outcome.kind,
                "stood": outcome.kind == "done",
                "end_time_s": outcome.time_s,
                "reason": outcome.reason or None,
                **{key: value for key, value in figures.items() if key not in NESTED},
            }
            for world, outcome, figures in zip(worlds, self.outcomes, self._summaries(estimator), strict=True)
        ]

    def table(self) -> pa.Table:
        """Make a table with a row per observer and world, open-loop observers after the one in the loop.

        Returns:
            Columns `observer`, `in_loop_of`, `world`, `seed`, `outcome`, `stood`, `end_time_s`, `reason`, then
            every figure of the summary, null where there is none. Where `stood` is false they are those until the end.
        """
        estimators = [None, *self._open_loop_names]
        return as_table(row for estimator in estimators for row in self.rows(estimator))

    def to_pandas(self) -> pd.DataFrame:
        """Make a pandas frame of `table`.

        Raises:
            InputError: pandas is not installed.
        """
        return frame_of(self.table())

    @cached_property
    def columns(self) -> Mapping[str, np.ndarray]:
        """The columns of `table`."""
        table = self.table()
        return {name: table[name].to_numpy() for name in table.column_names}

    def split(self, count: int) -> list[Result]:
        """Split the worlds into groups of equal size, in the order in which `run_many` was given them.

        Args:
            count: How many groups.

        Returns:
            A result a group, (count,).

        Raises:
            InputError: The worlds do not make so many equal groups.
        """
        worlds = len(self.outcomes)
        if count < 1 or worlds % count:
            raise InputError(
                f"split({count}): {worlds} worlds do not make {count} equal groups. Give a divisor of {worlds}"
            )
        size = worlds // count
        return [self.select(slice(i * size, (i + 1) * size)) for i in range(count)]

    def select(self, worlds: slice) -> Result:
        """Return neighbouring worlds."""
        return replace(
            self,
            outcomes=self.outcomes[worlds],
            summaries=self.summaries[worlds],
            trajectory=None if self.trajectory is None else self.trajectory.of_worlds(worlds),
            world_ids=self.world_ids[worlds],
        )
