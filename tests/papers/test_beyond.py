"""The step beyond: lag and noise gain against closed forms, and the studies on seeds that the report does not use."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cmg_mj.observers import Measurement, make_observer
from cmg_mj.papers.beyond import claims as beyond
from cmg_mj.papers.beyond.character import Motion, character, push_lag, record_motion, update_us
from cmg_mj.papers.beyond.league import league, markdown
from tests.observers.reference import DT, PAPER

SEED = 410_000


class Late:
    """The difference of two samples, some samples late."""

    def __init__(self, samples: int) -> None:
        self.samples = samples

    def init(self, y: Measurement) -> tuple:
        return (y.y1,) * (self.samples + 2)

    def step(self, state: tuple, y: Measurement, u: float) -> tuple[tuple, tuple]:
        state = (*state[1:], y.y1)
        return state, (y.y1, (state[1] - state[0]) / DT, y.y2)


class Blind(Late):
    """One that sees no rate at all."""

    def step(self, state: tuple, y: Measurement, u: float) -> tuple[tuple, tuple]:
        return state, (y.y1, 0.0, y.y2)


@pytest.fixture(scope="module")
def motion() -> Motion:
    return record_motion(400.0, 8, SEED)


@pytest.mark.parametrize("samples", [0, 3, 10])
def test_lag_of_a_known_delay(samples: int) -> None:
    """Whole samples late, and half a sample for the difference."""
    late: Any = Late(samples)
    assert push_lag(late, PAPER, DT) == pytest.approx((samples + 0.5) * DT, rel=0.02)


def test_lag_of_one_that_never_sees_the_push() -> None:
    blind: Any = Blind(0)
    assert push_lag(blind, PAPER, DT) is None


def test_lag_of_the_linear_differentiator() -> None:
    """1/(tau s + 1)^2 delays slow motion by 2 tau; the push is no slow motion, so by a little less."""
    for tau in (0.01, 0.02):
        lag = push_lag(make_observer("linear", DT, PAPER, tau=tau), PAPER, DT)
        assert lag is not None
        assert 0.85 * 2.0 * tau < lag < 2.0 * tau


@pytest.mark.parametrize("kind", ["finite_difference", "linear", "linear_high_gain"])
def test_noise_gain_is_that_of_the_impulse_response(kind: str, motion: Motion) -> None:
    """For a linear observer without a model: the root of the sum of squares of its answer to one sample."""
    observer = make_observer(kind, DT, motion.experiment.plant.reduced)
    state, answer = observer.init(Measurement(0.0, 0.0)), []
    for k in range(300):
        state, estimate = observer.step(state, Measurement(1.0 if k == 0 else 0.0, 0.0), 0.0)
        answer.append(estimate[1])
    expected = math.sqrt(sum(value**2 for value in answer))
    assert character(kind, motion).noise_gain_per_s == pytest.approx(expected, rel=0.05)
    if kind == "finite_difference":
        assert expected == pytest.approx(math.sqrt(2.0) / DT)


def test_an_update_takes_time(motion: Motion) -> None:
    assert update_us("linear", motion, repeats=1) > 0.0


def test_nothing_is_better_than_the_floor() -> None:
    shares: list[float] = []
    rows = league(4, SEED + 1, shares.append, ("homogeneous", "linear", "luenberger"))
    assert len(rows) == 3 * 3 * 3
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    for row in rows:
        assert row["worlds"] == 4
        assert row["stood"] == round(4 * (1.0 - row["fell_fraction"]))
        assert row["fell_fraction_low"] <= row["fell_fraction"] <= row["fell_fraction_high"]
        if row["ratio_to_floor"] is not None:
            assert row["ratio_to_floor"] > 1.0
            assert row["velocity_rms_error_rad_s_low"] < row["velocity_rms_error_rad_s"]
    fallen = [row for row in rows if row["observer"] == "luenberger" and row["bias_deg"] == 1.0]
    assert all(row["fell_fraction"] == 1.0 and row["velocity_rms_error_rad_s"] is None for row in fallen)
    table = markdown(rows)
    assert table.count("`homogeneous`") == 9
    assert "**400 ug/rtHz, e = 0.5 deg**" in table


def test_most_of_what_a_friction_model_brings_is_damping() -> None:
    """It helps on the rig that rubs; it helps on the one that does not, too; and a little of it is due to knowing."""
    figures = beyond.friction(24, SEED + 2)
    rubbing, smooth, due = (
        figures[key]
        for key in ("gain_with_friction_rad_s", "gain_without_friction_rad_s", "gain_due_to_friction_rad_s")
    )
    assert rubbing[1] > 0.0
    assert smooth[1] > 0.0
    assert due[0] == pytest.approx(rubbing[0] - smooth[0], rel=1e-9)
    assert 0.0 < due[0] < smooth[0]


def test_the_bias_fed_in_helps_where_it_is_large() -> None:
    rows = beyond.fed_bias(12, SEED + 3, lambda share: None)
    by_bias = {row["bias_deg"]: row for row in rows}
    assert by_bias[1.0]["gain_rad_s"][1] > 0.0
    assert by_bias[1.5]["homogeneous_adaptive_fell_fraction"] <= by_bias[1.5]["homogeneous_fell_fraction"]


def test_a_gain_of_worlds_that_fell_is_none() -> None:
    assert beyond.gain(np.array([1.0, np.nan, np.nan]), np.array([0.5, 0.5, np.nan])) is None
