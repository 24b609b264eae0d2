"""Cells: what is counted of trials whose ends are known."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.features.sweeps.cells import _with_ends, cells_in_blocks, fell_interval
from tests.features.sweeps.synthetic_trials import BIAS, make_trials


def test_the_share_of_falls_is_of_those_that_fell_or_stood() -> None:
    """One that never ran tells nothing of falls; where none ran there is no share, and no interval."""
    trials = make_trials({BIAS: "0,1,2"}, ("linear",), 4, lambda _, __, world: None if world == 0 else 1.0)
    trials.outcome[1, 0, 1:3] = "stopped"
    trials.outcome[2] = "refused"
    trials.stood = trials.outcome == "done"
    (table,) = cells_in_blocks(trials)
    full, part, none = table.to_pylist()
    for row, n_fallen, n_survivors in ((full, 1, 3), (part, 1, 1)):
        assert (row["fell"], row["stood"], row["stopped"]) == (n_fallen, n_survivors, 4 - n_fallen - n_survivors)
        assert (row["fell_share"], row["fell_low"], row["fell_high"]) == pytest.approx(
            fell_interval(n_fallen, n_fallen + n_survivors)
        )
    assert (none["trials"], none["stopped"]) == (4, 4)
    assert (none["fell_share"], none["fell_low"], none["fell_high"]) == (None, None, None)


def test_cells_of_few_worlds_have_their_mean_and_no_interval() -> None:
    """Three worlds make no interval of what cannot be negative; of what can, they do."""
    few = _with_ends("error", np.array([1.0, np.nan, 2.0, 6.0]), positive=True)
    assert few == {"error": 3.0, "error_low": None, "error_high": None}
    assert _with_ends("error", np.array([1.0, np.nan, 2.0, 6.0]))["error_low"] is not None
