"""The best few, and axes that one bad line cannot take."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cmg_mj.visualization.plots.readability import (
    FEW,
    MARGIN,
    REACH,
    SummaryValue,
    axis_range,
    error_range,
    fall_start,
    free_corner,
    is_seen,
    labelled_step,
    labelled_ticks,
    observers_to_draw,
    short_names,
    stretched,
    with_scale,
)

TRUE = 0.5 * np.sin(np.linspace(0.0, 20.0, 2001))
"""From -0.5 to 0.5."""


def with_margin(low: float, high: float) -> object:
    room = MARGIN * (high - low)
    return pytest.approx((low - room, high + room), rel=1e-3)


def noise(size: float) -> np.ndarray:
    return size * np.random.default_rng(0).standard_normal(len(TRUE))


def test_what_must_be_seen_is_seen_whole() -> None:
    spike = TRUE.copy()
    spike[7] = 4.0
    assert axis_range([spike]) == with_margin(-0.5, 4.0)
    assert axis_range([TRUE, spike]) == with_margin(-0.5, 4.0)


def test_an_outlier_of_an_estimate_is_not() -> None:
    spike = TRUE.copy()
    spike[7] = 1e6
    assert axis_range([TRUE], [spike]) == with_margin(-0.5, 0.5)


@pytest.mark.parametrize("bad", [noise(100.0), np.geomspace(1.0, 1e300, 2001), np.geomspace(1.0, 1e300, 2001) * -1.0])
def test_a_noisy_or_diverging_estimate_leaves_room_for_the_truth(bad: np.ndarray) -> None:
    result = axis_range([TRUE], [bad])
    assert result is not None
    assert result[1] - result[0] <= (1.0 + 2.0 * REACH) * (1.0 + 2.0 * MARGIN) * 1.001
    assert result[0] < -0.5
    assert result[1] > 0.5


def test_a_moderate_estimate_has_its_noise_shown() -> None:
    result = axis_range([TRUE], [noise(0.4)])
    assert result is not None
    assert result[0] < -0.8
    assert result[1] > 0.8


def test_values_that_are_none_are_passed_over() -> None:
    broken = np.array([math.nan, math.inf, -math.inf])
    assert axis_range([TRUE, broken], [broken]) == with_margin(-0.5, 0.5)
    assert axis_range([broken], [TRUE]) == axis_range([], [TRUE])


@pytest.mark.parametrize("nothing", [[], [np.empty(0)], [np.full(3, math.nan)], [np.zeros(3)], [np.ones((2, 2))]])
def test_no_range_where_there_is_none(nothing: list[np.ndarray]) -> None:
    assert axis_range(nothing) is None


def summary(error: float | None, *, push: float | None = None, fell: bool = False) -> dict[str, SummaryValue]:
    return {"velocity_rms_error_rad_s": error, "velocity_rms_error_push_rad_s": push, "fell": fell}


def test_the_best_in_the_order_given() -> None:
    errors = {"a": 0.4, "b": 0.1, "c": 0.3, "d": 0.2, "e": None, "f": math.nan}
    summaries = {name: summary(error) for name, error in errors.items()}
    assert observers_to_draw(summaries) == ["b", "c", "d"]
    assert observers_to_draw(summaries, ["e"]) == ["b", "d", "e"]
    assert observers_to_draw(summaries, list("acef")) == ["a", "c", "e", "f"]
    assert observers_to_draw({name: summaries[name] for name in "fa"}) == ["f", "a"]


def test_one_that_fell_is_not_among_the_best() -> None:
    summaries = {name: summary(i / 10.0) for i, name in enumerate("abcde")}
    summaries["a"]["fell"] = True
    assert observers_to_draw(summaries) == ["b", "c", "d"]


def test_the_push_decides_where_it_is_known() -> None:
    summaries = {
        name: summary(error, push=1.0 - error) for name, error in zip("abcd", (0.1, 0.2, 0.3, 0.4), strict=True)
    }
    assert observers_to_draw(summaries) == ["b", "c", "d"]


def test_what_observers_are_compared_with_is_not_among_the_best() -> None:
    summaries = {name: summary(i / 10.0) for i, name in enumerate(("zero", "mems_gyro", "a", "b", "c", "d"))}
    assert observers_to_draw(summaries) == ["a", "b", "c"]
    assert len(observers_to_draw({name: summary(0.1) for name in ("zero", "mems_gyro", "a")})) == FEW


TIME = np.linspace(0.0, 10.0, 1001)
PEAK = np.exp(-np.square((TIME - 2.0) / 0.1))


@pytest.mark.parametrize(
    ("values", "corner"),
    [
        (PEAK, ("right", "top")),
        (PEAK[::-1], ("left", "top")),
        (PEAK + 0.02 * noise(1.0)[:1001], ("right", "top")),
        (np.exp(TIME), ("left", "top")),
        (1.0 - np.exp(-TIME), ("right", "bottom")),
        (np.ones_like(TIME), ("right", "top")),
        (np.full_like(TIME, math.nan), ("right", "top")),
        (np.stack([PEAK, -PEAK], axis=1), ("right", "top")),
    ],
)
def test_a_legend_hides_no_excursion(values: np.ndarray, corner: tuple[str, str]) -> None:
    side, end = free_corner([(TIME, values)], axis_range([values]))
    assert (side, end) == corner or (corner == ("right", "top") and side == "right")


def test_a_legend_where_there_is_no_line() -> None:
    assert free_corner([], None) == ("right", "top")
    assert free_corner([(np.empty(0), np.empty(0))], None) == ("right", "top")
    assert free_corner([(np.array([1.0, 1.0]), np.array([1e300, -1e300]))], (-1.0, 1.0)) == ("right", "top")


def test_names_are_shortened_where_they_stay_apart() -> None:
    names = ["linear", "mine:Kalman", "lab.a:Other", "lab.b:Other", "odd:"]
    assert list(short_names(names).values()) == ["linear", "Kalman", "lab.a:Other", "lab.b:Other", "odd:"]
    assert list(short_names(["mine:linear", "linear"]).values()) == ["mine:linear", "linear"]


@pytest.mark.parametrize(
    "axis", [(-0.64, 0.7), (0.01, 0.09), (-13.0, -12.9), (-1.2e-3, 0.4e-3), (0.0, 1.9), (5.0, 95.0)]
)
@pytest.mark.parametrize("height", [120.0, 250.0])
def test_an_axis_has_two_labelled_ticks(axis: tuple[float, float], height: float) -> None:
    low, high = with_scale(axis, height)
    assert low <= axis[0]
    assert axis[1] <= high
    assert len(labelled_ticks((low, high), height)) >= 2
    assert high - low <= 2.5 * max(axis[1] - axis[0], 0.4 * labelled_step(axis, height))


def test_an_axis_with_a_scale_stays() -> None:
    """Steps of 0.1, 22 points apart, are labelled; 20 points apart they are not."""
    assert with_scale((-0.45, 0.65), 242.0) == (-0.45, 0.65)
    assert labelled_ticks((-0.45, 0.65), 220.0) == [0.0]
    assert with_scale((-0.45, 0.65), 220.0) == pytest.approx((-0.45, 1.03))


def test_a_fall_begins_where_the_tilt_only_rises() -> None:
    time = np.arange(8.0)
    tilt = np.array([1.0, 0.5, -0.5, -0.2, -0.1, -0.4, -2.0, -9.0])
    assert fall_start(time, tilt, fell=True) == 4.0
    assert fall_start(time, tilt, fell=False) == math.inf
    assert fall_start(time[:1], tilt[:1], fell=True) == 0.0


def test_a_fall_stretches_an_axis_by_its_span_at_most() -> None:
    assert stretched((-1.0, 1.0), [np.array([0.0, 50.0])]) == (-1.0, 3.0)
    assert stretched((-1.0, 1.0), [np.array([1.5, math.nan])]) == (-1.0, 1.5)
    assert stretched(None, [np.array([0.0, 1.0])]) == pytest.approx((-0.05, 1.05))


def test_errors_get_at_least_the_span_of_the_rate() -> None:
    rate = np.array([-0.4, 0.6])
    low, high = error_range([rate], [np.array([-0.5, 0.1])]) or (0.0, 0.0)
    assert (low + high) / 2.0 == pytest.approx(-0.2)
    assert high - low == pytest.approx(1.1)
    low, high = error_range([rate], [np.linspace(0.5, 900.0, 10_000)]) or (0.0, 0.0)
    assert low <= 0.0
    assert 3.6 < high < 4.2


def test_bounds_on_both_sides_of_an_axis_are_not_seen() -> None:
    bounds = np.tile([4.7, -4.7], (2, 1))
    assert not is_seen(bounds, (-1.0, 1.0))
    assert is_seen(bounds, (-1.0, 5.0))
    assert is_seen(bounds, None)
    assert not is_seen(np.array([math.nan]), None)
