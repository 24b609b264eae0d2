"""A sweep from Python, in this process, on one object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import pyarrow as pa

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.features.sweeps.cells import Trials, cells_in_blocks
from cmg_mj.features.sweeps.chunks import compute, table_of, trials_schema
from cmg_mj.features.sweeps.study import WORLDS, SweepStudy, Variation, check_values, parse_axis
from cmg_mj.results.trajectory import frame_of
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario

if TYPE_CHECKING:
    import pandas as pd


class SweepResult(dict[str, pa.Table]):
    """The tables of a sweep, by name: `result["cells"]`, `dict(result)`.

    Attributes:
        study: The sweep.
        trials: A row a trial: its point, what is varied, observer, world, outcome, and the figures of its run.
        cells: A row a point and observer: means with 95 % intervals, the share of falls with Wilson's interval, and the
            paired difference to the best observer of the point.
    """

    def __init__(self, study: SweepStudy, trials: pa.Table, cells: pa.Table) -> None:
        super().__init__(trials=trials, cells=cells)
        self.study, self.trials, self.cells = study, trials, cells

    def to_pandas(self, table: str = "cells") -> pd.DataFrame:
        """Make a pandas frame of one table.

        Args:
            table: The table's name: `cells` or `trials`.

        Returns:
            The frame.

        Raises:
            InputError: pandas is not installed, or the sweep has no such table.
        """
        if table not in self:
            raise InputError(f"to_pandas: {table!r} is no table of this sweep; {nearest(table, self)}")
        return frame_of(self[table])


def sweep(
    scenario: Scenario | str,
    vary: Mapping[str, Variation],
    observers: Sequence[str] | None = None,
    worlds: int = WORLDS,
    sample: int | None = None,
) -> SweepResult:
    """Run a scenario in every cell: every point of what is varied with every observer.

    Args:
        scenario: The scenario, or its name.
        vary: Field, named as with `--set` -> a list of values, or one, or text as `--vary` takes it, such as "-1:1:5".
        observers: The observers in the loop; by default the scenario's own. Baselines too, such as `zero`, whose trials
            are those of a loop with the true rate.
        worlds: Trials a cell: world i has the same noise in every cell.
        sample: Number of points of a quasi-random design of the ranges and lists, instead of every combination.

    Returns:
        The trials and cells, as tables.

    Raises:
        InputError: A field or its values are not written so or do not fit the design, or an observer cannot run.
    """
    base = load_scenario(scenario) if isinstance(scenario, str) else scenario
    axes = tuple(parse_axis(field, values, f"vary: {field!r}") for field, values in vary.items())
    if isinstance(observers, str):
        raise InputError(f"observers = {observers!r}: must be a list of names, such as ['linear', 'ltv']")
    names = (base.observer.kind,) if observers is None else tuple(observers)
    study = SweepStudy(base, axes, names, worlds, sample)
    check_values(study)
    rows = (compute(study, *study.chunk(number)) for number in range(study.n_chunks))
    table = pa.concat_tables(table_of(chunk_rows, trials_schema(study)) for chunk_rows in rows)
    trials = Trials(study, [table])
    return SweepResult(study, table, pa.concat_tables(cells_in_blocks(trials)))
