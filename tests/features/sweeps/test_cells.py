"""Cells, leaders and Sobol indices of trials whose ends are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmg_mj.features.sweeps.cells import cells_in_blocks, cells_of, fell_interval, lead_rows, with_ends
from cmg_mj.features.sweeps.report import report
from cmg_mj.features.sweeps.sobol import LOST, IndexRow, index_rows, indices
from cmg_mj.features.sweeps.study import sampled
from tests.features.sweeps.synthetic_trials import BIAS, NOISE, VELOCITY, make_study, make_trials

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
    assert linear == ("linear", False, 3, 2, 3, 6)
    assert ltv == ("ltv", False, 2, 2, 5, 6)
    assert zero[:4] == ("zero", True, 4, 3)  # at 200 and 400, and where nobody stood; the leader's pull apart at 400
    rows = {(row["point"], row["observer"]): row for row in cells_of(trials)}
    assert rows[1, "zero"][f"{VELOCITY}_best"] == "linear"
    assert rows[1, "zero"][f"{VELOCITY}_behind_best"] == pytest.approx(0.15 - 0.18)


def test_of_a_design_for_indices_the_independent_points_count() -> None:
    trials = make_trials({BIAS: "0:1", NOISE: "100:400"}, ("linear", "zero"), 2, lambda *_: 0.1, design="sobol", n=4)
    assert (lead_rows(trials, VELOCITY)[0].leads, lead_rows(trials, VELOCITY)[0].points) == (8, 8)
    assert "8 of 8" in report(trials, [], [])


# --- Sobol indices

RANGES = {BIAS: "0:1", NOISE: "100:200"}


def ishigami(shares: np.ndarray) -> np.ndarray:
    x = np.pi * (2.0 * shares - 1.0)
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_the_indices_of_a_known_function() -> None:
    """Ishigami's: 0.314, 0.442, 0 and 0.558, 0.442, 0.244 in closed form."""
    first, total = np.array([0.3139, 0.4424, 0.0]), np.array([0.5576, 0.4424, 0.2437])
    n = 1024
    study = make_study({"a": "0:1", "b": "0:1", "c": "0:1"}, design="sobol", n=n)
    values = ishigami(np.array([list(study.point(number).values()) for number in range(study.n_points)]))
    result = indices(values, n, 0)
    np.testing.assert_allclose(result.first, first, atol=0.03)
    np.testing.assert_allclose(result.total, total, atol=0.03)
    for low, known_index, high in (
        (result.first_low, first, result.first_high),
        (result.total_low, total, result.total_high),
    ):
        assert (low <= known_index).all()
        assert (known_index <= high).all()
        assert (high - low < 0.4).all()
    assert all(np.array_equal(a, b) for a, b in zip(result, indices(values, n, 0), strict=True))


@pytest.mark.parametrize(("weights", "decisive"), [((4.0, 1.0), [True, False]), ((1.0, 1.0), [False, False])])
def test_decisive_only_where_intervals_part(weights: tuple[float, float], decisive: list[bool]) -> None:
    n = 256
    assert indices(sampled(2, n, 3, indices=True) @ np.array(weights), n, 0).decisive.tolist() == decisive


def rows_by_place(figure: str, error: Any, n: int = 64, worlds: int = 2) -> dict[tuple[str, str], IndexRow]:
    trials = make_trials(RANGES, ("linear", "ltv"), worlds, error, design="sobol", n=n)
    return {(row["observer"], row["field"]): row for row in index_rows(trials) if row["figure"] == figure}


def test_the_mean_over_the_worlds_is_decomposed() -> None:
    """Worlds that pull apart by the noise, and by nothing in their mean."""
    rows = rows_by_place(VELOCITY, lambda point, _, world: point[BIAS] + (2 * world - 1) * point[NOISE])
    assert rows["linear", BIAS]["total"] == pytest.approx(1.0, abs=0.1)
    assert rows["linear", NOISE]["total"] == pytest.approx(0.0, abs=1e-9)
    assert (rows["ltv", BIAS]["decisive"], rows["ltv", NOISE]["decisive"]) == (True, False)


def test_indices_are_refused_with_counts_where_a_world_fell() -> None:
    def falling(point: dict[str, Any], name: str, world: int) -> float | None:
        return None if name == "ltv" and world and point[BIAS] > 0.5 else point[BIAS]

    study = make_study(RANGES, design="sobol", n=64)
    n_fallen = sum(1 for number in range(study.n_points) if study.point(number)[BIAS] > 0.5)
    assert 0 < n_fallen < 256
    rows = rows_by_place(VELOCITY, falling)
    assert rows["ltv", BIAS]["refused"] == f"no value at {n_fallen} of 256 points: of 512 trials {n_fallen} fell"
    assert rows["ltv", BIAS]["total"] is rows["ltv", BIAS]["decisive"] is None
    assert rows["linear", BIAS]["refused"] is None
    assert {row["refused"] for row in rows_by_place(VELOCITY, lambda *_: 0.1).values()} == {"the same at every point"}


def test_indices_are_refused_where_only_points_of_the_crossed_blocks_differ() -> None:
    """The variance is that of A and B: with none there indices would be 0, from 0 to 0."""
    study = make_study(RANGES, design="sobol", n=64)
    points = [study.point(number) for number in range(study.n_points)]
    assert points[-1] not in points[:128]
    for row in rows_by_place(LOST, lambda point, *_: None if point == points[-1] else 1.0, worlds=1).values():
        assert row["total"] is None
        assert row["refused"].startswith("the same at all 128 independent points of the design")
