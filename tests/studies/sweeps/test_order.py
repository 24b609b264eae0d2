"""The share of worlds in which a named order of observers holds."""

from __future__ import annotations

import pytest

from cmg_mj.errors import InputError
from cmg_mj.studies.sweeps.order import by_quarters, order_counts, order_of_points, order_rows
from cmg_mj.studies.sweeps.report_sections import order as section
from tests.studies.sweeps.synthetic_trials import BIAS, NOISE, VELOCITY, make_trials

NAMES = ("linear", "ltv", "homogeneous")
ORDER = ("homogeneous", "ltv", "linear")


def count_order(*worlds: tuple[float | None, float | None, float | None]) -> tuple[int, int]:
    """Count at one point, from the errors of the order's observers in each world."""
    trials = make_trials(
        {BIAS: "0"}, NAMES, len(worlds), lambda _, name, world: worlds[world][ORDER.index(name)], order=ORDER
    )
    return order_counts(trials)[VELOCITY][0]


@pytest.mark.parametrize(
    ("errors", "count"),
    [
        ((1.0, 2.0, 3.0), (1, 1)),
        ((1.0, 3.0, 2.0), (0, 1)),
        ((1.0, 1.0, 2.0), (0, 1)),
        ((1.0, 2.0, None), (1, 1)),
        ((None, 1.0, 2.0), (0, 1)),
        ((1.0, None, None), (0, 0)),
        ((None, None, None), (0, 0)),
        ((None, None, 1.0), (0, 1)),  # the two that are to be better fell: that breaks it
        ((2.0, 1.0, None), (0, 1)),
    ],
)
def test_a_world(errors: tuple[float | None, float | None, float | None], count: tuple[int, int]) -> None:
    assert count_order(errors) == count


@pytest.mark.parametrize("loser", range(3))
@pytest.mark.parametrize("world_0", [(1.0, 2.0, 3.0), (3.0, 2.0, 1.0), (None, 2.0, 3.0)])
@pytest.mark.parametrize("outcome", ["stopped", "refused"])
def test_a_stop_cannot_tell(world_0: tuple[float | None, ...], loser: int, outcome: str) -> None:
    """It is no error of the observer's that loses, and none of the others' that wins."""
    errors = {0: world_0, 1: (1.0, 2.0, 3.0)}
    trials = make_trials({BIAS: "0"}, NAMES, 2, lambda _, name, world: errors[world][ORDER.index(name)], order=ORDER)
    trials.outcome[0, NAMES.index(ORDER[loser]), 0] = outcome
    trials.stood = trials.outcome == "done"
    assert order_counts(trials) == {VELOCITY: [(1, 1)]}
    assert order_of_points(trials, VELOCITY, ORDER) == (0, 0)
    pair = [name for name in ORDER if name != ORDER[loser]]
    assert order_of_points(trials, VELOCITY, pair).decided == 1


def test_the_share_has_wilsons_interval() -> None:
    trials = make_trials(
        {BIAS: "0,1"}, NAMES, 10, lambda p, name, w: ORDER.index(name) * (w < 8 or p[BIAS]), order=ORDER
    )
    first, second = order_rows(trials.study, order_counts(trials))
    assert (first["held"], first["worlds"], first["share"]) == (8, 10, 0.8)
    assert (first["low"], first["high"]) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert (second["held"], second["share"]) == (10, 1.0)
    first, whole_row, *_ = section(trials, order_counts(trials))[2].splitlines()[::2]
    assert first.split("|")[1].strip() == "counted by"
    assert [cell.strip() for cell in whole_row.split("|")[2:-1]] == ["homogeneous < ltv < linear", "2 of 2", "18 of 20"]


def test_points_by_their_means() -> None:
    """One bad world of three turns the mean, and a fall does so whatever the others are."""
    world_0 = {0: {"ltv": 10.0}, 1: {"ltv": None}, 2: {}}
    trials = make_trials(
        {BIAS: "0,1,2"},
        NAMES,
        3,
        lambda p, name, w: world_0[p[BIAS]].get(name, ORDER.index(name)) if w == 0 else float(ORDER.index(name)),
        order=ORDER,
    )
    assert order_of_points(trials, VELOCITY, ORDER) == (1, 3)
    assert order_of_points(trials, VELOCITY, ("homogeneous", "ltv")) == (3, 3)  # a fall is worse
    assert order_of_points(trials, VELOCITY, ("ltv", "linear")) == (1, 3)


def test_by_quarters_of_a_range_and_values_of_a_list() -> None:
    """It holds where a field is above its lower half; the other one does not matter."""
    trials = make_trials(
        {BIAS: "0:4", NOISE: "100,200"},
        NAMES,
        2,
        lambda p, name, _: float(ORDER.index(name) if p[BIAS] > 2.0 else -ORDER.index(name)),
        order=ORDER,
        design="sample",
        n=64,
    )
    rows = by_quarters(trials, VELOCITY)
    assert [row[0] for row in rows] == [BIAS] * 4 + [NOISE] * 2
    assert [row[3] for row in rows[:4]] == [(0, 16), (0, 16), (16, 16), (16, 16)]
    assert rows[0][2] <= 1.0 <= rows[1][1]
    assert [(row[1], row[2], row[3].decided) for row in rows[4:]] == [(100, 100, 32), (200, 200, 32)]
    assert "quarter" in section(trials, order_counts(trials))[-3]


@pytest.mark.parametrize(
    ("order", "complaint"),
    [
        (("ltv",), "write two observers or more"),
        (("ltv", "ltv"), "each once"),
        (("ltv", "kalman"), "kalman does not run here; --observers are linear, ltv, homogeneous"),
    ],
)
def test_what_is_no_order(order: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(InputError, match=f"--order .*{complaint}"):
        make_trials({BIAS: "0"}, NAMES, 1, lambda *_: 1.0, order=order)
