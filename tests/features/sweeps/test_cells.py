"""Cells and leaders of trials whose ends are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmg_mj.features.sweeps.cells import cells_in_blocks, cells_of, fell_interval, lead_rows, with_ends
from tests.features.sweeps.synthetic_trials import BIAS, NOISE, VELOCITY, make_trials

OBSERVERS = ("linear", "zero", "ltv")
GRID = {BIAS: "0,1", NOISE: "100,200,400"}


def test_the_share_of_falls_is_of_those_that_fell_or_stood() -> None:
    """One that never ran tells nothing of falls; where none ran there is no share, and no interval."""

    def end(point: dict[str, Any], _: str, world: int) -> float | str | None:
        if point[BIAS] == 2 or (point[BIAS] == 1 and world in (1, 2)):
            return "refused" if point[BIAS] == 2 else "stopped"
        return None if world == 0 else 1.0

    (table,) = cells_in_blocks(make_trials({BIAS: "0,1,2"}, ("linear",), 4, end))
    full, part, none = table.to_pylist()
    for row, n_fallen, n_survivors in ((full, 1, 3), (part, 1, 1)):
        assert (row["fell"], row["stood"], row["stopped"]) == (n_fallen, n_survivors, 4 - n_fallen - n_survivors)
        share = (row["fell_share"], row["fell_low"], row["fell_high"])
        assert share == pytest.approx(fell_interval(n_fallen, n_fallen + n_survivors))
    assert (none["trials"], none["stopped"]) == (4, 4)
    assert (none["fell_share"], none["fell_low"], none["fell_high"]) == (None, None, None)


def test_cells_of_few_worlds_have_their_mean_and_no_interval() -> None:
    """Three worlds make no interval of what cannot be negative; of what can, they do."""
    values = np.array([1.0, np.nan, 2.0, 6.0])
    assert with_ends("error", values, positive=True) == {"error": 3.0, "error_low": None, "error_high": None}
    assert with_ends("error", values)["error_low"] is not None


# --- leaders


def error(point: dict[str, Any], name: str, world: int) -> float | None:
    """At 0 degrees linear is ahead of ltv by a tenth, surely but at 400; at 1 degree it falls, ltv too at 400.

    Zero has 0.15 throughout, and ltv the noise in 1e-3.
    """
    if name == "zero":
        return 0.15
    falls = point[BIAS] == 1 and (name == "linear" or point[NOISE] == 400)
    if falls and world == 0:
        return None
    ltv = 1e-3 * point[NOISE]
    chance = 0.5 * ltv * (-1.0) ** world if point[NOISE] == 400 else 0.0
    return ltv if name == "ltv" else 0.9 * ltv + chance


def test_leaders_are_counted_and_baselines_stand_apart() -> None:
    trials = make_trials(GRID, OBSERVERS, 4, error)
    linear, ltv, zero = lead_rows(trials, VELOCITY)
    assert linear == ("linear", False, 3, 2, 3)
    assert ltv == ("ltv", False, 2, 2, 5)
    assert zero[:4] == ("zero", True, 4, 3)  # at 200 and 400, and where nobody stood; the leader's pull apart at 400
    rows = {(row["point"], row["observer"]): row for row in cells_of(trials)}
    assert rows[1, "zero"][f"{VELOCITY}_best"] == "linear"
    assert rows[1, "zero"][f"{VELOCITY}_behind_best"] == pytest.approx(0.15 - 0.18)
