"""A comparison of observers from Python, in this process, on one object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from cmg_mj.core.errors import InputError
from cmg_mj.results.summary_keys import Summary
from cmg_mj.results.trajectory import frame_of
from cmg_mj.runs import comparison
from cmg_mj.runs.comparison import ComparedObserver, standings, worlds_table
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

WORLDS = 20
"""Worlds an observer by default."""


class Comparison(dict[str, ComparedObserver]):
    """Observers on the same plant, pushes and noise, by name: `comparison["gyro_free"]`.

    Each has the observer's experiment, the result of all worlds, and world 0 with its trajectory.
    """

    @property
    def observers(self) -> Mapping[str, ComparedObserver]:
        """Name -> observer: the comparison itself."""
        return self

    @property
    def summaries(self) -> list[Summary]:
        """Summaries of the observers, then the baselines: means over the worlds, with 95 % intervals."""
        return standings(list(self.values()))

    def table(self) -> pa.Table:
        """Make a table with a row per observer and world, then the baselines' rows: columns as in `Result.table`."""
        return worlds_table(list(self.values()))

    def to_pandas(self) -> pd.DataFrame:
        """Make a pandas frame of `table`.

        Raises:
            InputError: pandas is not installed.
        """
        return frame_of(self.table())


def compare(scenario: Scenario | str, observers: Sequence[str], worlds: int = WORLDS) -> Comparison:
    """Run every observer in many worlds: world i has the same plant, pushes and noise for each observer.

    Args:
        scenario: The scenario, or its name.
        observers: The observers' names, or `package.module:Class`; each takes its turn in the loop.
        worlds: Worlds an observer.

    Returns:
        The comparison.

    Raises:
        InputError: An observer does not exist or is named twice, or something does not fit.
    """
    if isinstance(observers, str) or not observers or len(set(observers)) < len(observers):
        raise InputError(f"observers = {observers!r}: must be a list of different names")
    if worlds < 1:
        raise InputError(f"worlds = {worlds}: must be at least 1")
    base = load_scenario(scenario) if isinstance(scenario, str) else scenario
    compared = comparison.compare(comparison.prepare_comparison(base, observers), worlds)
    return Comparison({entry.kind: entry for entry in compared})
