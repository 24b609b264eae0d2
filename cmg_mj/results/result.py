"""How the worlds of a run ended, and their numbers."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cmg_mj.errors import InputError, nearest
from cmg_mj.results.per_world_table import as_table, open_loop_figures, world_rows
from cmg_mj.results.trajectory import Trajectory

if TYPE_CHECKING:
    import pyarrow as pa

Driver = Literal["native", "callback", "board"]
"""Who calls the controller, or is it. `simulate` knows the first two: a board is the controller's processor."""


@dataclass
class Outcome:
    """How one world ended.

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
        """Whether the rig fell."""
        return self.kind == "fell"


@dataclass
class Result:
    """What `simulate` returns.

    Attributes:
        outcomes: How each world ended, (n_worlds,).
        summaries: Each world's numbers, (n_worlds,).
        trajectory: All ticks, if they were kept.
        seconds: Simulated time of the longest world [s].
        observers: The observer in the loop, then the open-loop observers.
        seed: Seed of the sensors' noise.
        worlds: The worlds' numbers, (n_worlds,).
        driver: Who called the controller, or was it.
    """

    outcomes: list[Outcome]
    summaries: list[dict[str, Any]]
    trajectory: Trajectory | None = None
    seconds: float = 0.0
    observers: Sequence[str] = ("",)
    seed: int = 0
    worlds: Sequence[int] = ()
    driver: Driver = "native"

    @property
    def stood(self) -> np.ndarray:
        """Which worlds stood to the end, (n_worlds,)."""
        return np.array([outcome.kind == "done" for outcome in self.outcomes])

    @property
    def fell(self) -> np.ndarray:
        """Which worlds fell, (n_worlds,)."""
        return np.array([outcome.fell for outcome in self.outcomes])

    def values(self, key: str, estimator: str | None = None) -> np.ndarray:
        """One number of every world's summary.

        Args:
            key: The summary's key, such as `velocity_rms_error_rad_s`.
            estimator: An open-loop observer or a baseline (`zero`, `mems_gyro`); None for the observer in the loop.

        Returns:
            (n_worlds,); NaN for a world that did not stand to the end, or has no such number.

        Raises:
            InputError: There is no such key or estimator.
        """
        of = self.summaries
        if estimator is not None:
            riding = open_loop_figures(self.summaries[0])
            if estimator not in riding:
                raise InputError(f"{estimator!r}: no open-loop observer of this run; {nearest(estimator, riding)}")
            of = [open_loop_figures(summary)[estimator] for summary in of]
        if key not in of[0]:
            raise InputError(f"{key!r}: not in the summary; {nearest(key, of[0])}")
        numbers = np.array([math.nan if s[key] is None else s[key] for s in of], dtype=float)
        return np.where(self.stood, numbers, math.nan)

    def mean(self, key: str, estimator: str | None = None) -> float | None:
        """Mean of `values` over the worlds that have one; None if no world has."""
        values = self.values(key, estimator)
        known = values[np.isfinite(values)]
        return statistics.fmean(known) if len(known) else None

    def rows(self, who: str | None = None) -> list[dict[str, Any]]:
        """One observer's rows of `table`: that in the loop, or something that rode along."""
        loop = self.observers[0]
        worlds = self.worlds or range(len(self.outcomes))
        return world_rows(loop, who or loop, self.seed, worlds, self.outcomes, self.summaries)

    def table(self) -> pa.Table:
        """Every world kept: a row per observer and world, those that rode along after the one in the loop.

        Returns:
            Columns `observer`, `in_loop_of`, `world`, `seed`, `outcome`, `stood`, `end_time_s`, `reason`, then
            every figure of the summary, null where there is none. Where `stood` is false they are those until the end.
        """
        names = [self.observers[0], *open_loop_figures(self.summaries[0])]
        return as_table(row for name in names for row in self.rows(name))

    def split(self, count: int) -> list[Result]:
        """The worlds in so many groups of equal size, in their order, as `run_many` was given them."""
        worlds = len(self.outcomes)
        if count < 1 or worlds % count:
            raise InputError(f"groups({count}): {worlds} worlds cannot be parted so")
        if count == 1:
            return [self]
        size = worlds // count
        return [self.select(slice(i * size, (i + 1) * size)) for i in range(count)]

    def select(self, worlds: slice) -> Result:
        """Some of the worlds, that stand beside each other."""
        return replace(
            self,
            outcomes=self.outcomes[worlds],
            summaries=self.summaries[worlds],
            trajectory=None if self.trajectory is None else self.trajectory.of_worlds(worlds),
            seconds=max(outcome.time_s for outcome in self.outcomes[worlds]),
            worlds=self.worlds[worlds],
        )
