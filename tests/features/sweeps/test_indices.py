"""Sobol indices of known functions, refused where a value is missing, decisive only where intervals part."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmg_mj.features.sweeps.sobol import LOST, IndexRow, index_rows, indices
from cmg_mj.features.sweeps.study import SweepStudy, sampled
from tests.features.sweeps.synthetic_trials import BIAS, NOISE, VELOCITY, make_trials


def ishigami(shares: np.ndarray) -> np.ndarray:
    x = np.pi * (2.0 * shares - 1.0)
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_the_indices_of_a_known_function() -> None:
    """Ishigami's: 0.314, 0.442, 0 and 0.558, 0.442, 0.244 in closed form."""
    first, total = np.array([0.3139, 0.4424, 0.0]), np.array([0.5576, 0.4424, 0.2437])
    n = 1024
    result = indices(ishigami(sampled(3, n, 1, indices=True)), n, 0)
    np.testing.assert_allclose(result.first, first, atol=0.03)
    np.testing.assert_allclose(result.total, total, atol=0.03)
    for low, known_index, high in (
        (result.first_low, first, result.first_high),
        (result.total_low, total, result.total_high),
    ):
        assert (low <= known_index).all()
        assert (known_index <= high).all()
        assert (high - low < 0.4).all()
    rerun = indices(ishigami(sampled(3, n, 1, indices=True)), n, 0)
    assert all(np.array_equal(a, b) for a, b in zip(result, rerun, strict=True))


@pytest.mark.parametrize(("weights", "decisive"), [((4.0, 1.0), [True, False]), ((1.0, 1.0), [False, False])])
def test_decisive_only_where_intervals_part(weights: tuple[float, float], decisive: list[bool]) -> None:
    n = 256
    assert indices(sampled(2, n, 3, indices=True) @ np.array(weights), n, 0).decisive.tolist() == decisive


def sobol(error: Any, n: int = 64) -> list[IndexRow]:
    trials = make_trials({BIAS: "0:1", NOISE: "100:200"}, ("linear", "ltv"), 2, error, design="sobol", n=n)
    assert isinstance(trials.study, SweepStudy)
    return [row for row in index_rows(trials) if row.figure == VELOCITY]


def test_what_is_decomposed_is_the_mean_over_the_worlds() -> None:
    """Worlds that pull apart by the noise, and by nothing in their mean."""
    rows = sobol(lambda point, _, world: point[BIAS] + (2 * world - 1) * point[NOISE])
    row_of = {(row.observer, row.field): row for row in rows}
    assert row_of["linear", BIAS].total == pytest.approx(1.0, abs=0.1)
    assert row_of["linear", NOISE].total == pytest.approx(0.0, abs=1e-9)
    assert (row_of["ltv", BIAS].decisive, row_of["ltv", NOISE].decisive) == (True, False)


def test_the_share_of_falls_has_indices() -> None:
    trials = make_trials(
        {BIAS: "0:1", NOISE: "100:200"},
        ("linear",),
        1,
        lambda point, *_: None if point[BIAS] > 0.5 else 1.0,
        design="sobol",
        n=256,
    )
    bias, noise = (row for row in index_rows(trials) if row.figure == LOST)
    assert (bias.first, bias.total) == pytest.approx((1.0, 1.0), abs=0.05)
    assert (noise.first, noise.total) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_refused_with_counts_where_a_world_fell() -> None:
    rows = sobol(lambda point, name, world: None if name == "ltv" and world and point[BIAS] > 0.5 else point[BIAS])
    n_fallen = sum(1 for point in make_points() if point[BIAS] > 0.5)
    for row in rows:
        if row.observer == "ltv":
            assert row.refused == f"no value at {n_fallen} of 256 points: of 512 trials {n_fallen} fell"
            assert row.total is None
            assert row.decisive is None
        else:
            assert row.refused is None
    assert 0 < n_fallen < 256


def test_refused_where_only_points_of_the_crossed_blocks_differ() -> None:
    """The variance is that of A and B: with none there indices would be 0, from 0 to 0."""
    points = make_points()
    fallen_point = points[-1]
    assert fallen_point not in points[:128]
    trials = make_trials(
        {BIAS: "0:1", NOISE: "100:200"},
        ("linear",),
        1,
        lambda point, *_: None if point == fallen_point else 1.0,
        design="sobol",
        n=64,
    )
    for row in (row for row in index_rows(trials) if row.figure == LOST):
        assert row.total is None
        assert row.refused == (
            "the same at all 128 independent points of the design: no variance to share out "
            "(another value at 1 of the 128 made of them; take more rows)"
        )


def make_points() -> list[dict[str, Any]]:
    trials = make_trials({BIAS: "0:1", NOISE: "100:200"}, ("linear",), 1, lambda *_: 1.0, design="sobol", n=64)
    return list(trials.study.points)


def test_the_same_everywhere_depends_on_nothing() -> None:
    assert {row.refused for row in sobol(lambda *_: 0.1)} == {"the same at every point"}
