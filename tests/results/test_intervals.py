"""Confidence intervals against scipy's, and what they say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from cmg_mj.results.intervals import (
    MIN_WORLDS,
    Interval,
    known_interval,
    mean_interval,
    paired_verdict,
    positive_mean_interval,
    ratio_interval,
)


def test_mean_interval_is_scipys() -> None:
    values = np.random.default_rng(0).normal(2.0, 0.5, 13)
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert mean_interval(values) == pytest.approx((values.mean(), expected.low, expected.high), rel=1e-12)


TIMES = 10_000
"""Samples of 100 worlds."""


def share_that_holds(mean: float, samples: np.ndarray) -> float:
    """Return the share of the samples, (n_samples, n_worlds), that have the mean in their interval."""
    result = [known_interval(values) for values in samples]
    return float(np.mean([interval is not None and interval.low <= mean <= interval.high for interval in result]))


@pytest.mark.daily_cases("chi-squared", "with falls")
@pytest.mark.parametrize("kind", ["normal", "uniform", "chi-squared", "with falls"])
def test_intervals_of_a_known_mean_cover_it(kind: str) -> None:
    """95 % intervals of 100 worlds, of a mean of 1: squared errors are skewed, and some worlds fall."""
    rng = np.random.default_rng(7)
    samples = {
        "normal": lambda: rng.normal(1.0, 0.3, (TIMES, 100)),
        "uniform": lambda: rng.uniform(0.0, 2.0, (TIMES, 100)),
        "chi-squared": lambda: rng.chisquare(4.0, (TIMES, 100)) / 4.0,
        "with falls": lambda: np.where(rng.random((TIMES, 120)) < 0.1, np.nan, rng.normal(1.0, 0.3, (TIMES, 120))),
    }[kind]()
    assert 0.925 <= share_that_holds(1.0, samples) <= 0.975


SKEWED: dict[str, tuple[float, Callable[[np.random.Generator, tuple[int, int]], np.ndarray]]] = {
    "exponential": (1.0, lambda rng, shape: rng.exponential(1.0, shape)),
    "lognormal": (float(np.exp(0.5)), lambda rng, shape: rng.lognormal(0.0, 1.0, shape)),
    "half are zero": (0.5, lambda rng, shape: np.where(rng.random(shape) < 0.5, 0.0, rng.exponential(1.0, shape))),
}
"""Positive quantities: the mean, and samples of them."""


def covered(mean: float, intervals: list[Interval]) -> float:
    return float(np.mean([low <= mean <= high for _, low, high in intervals]))


@pytest.mark.daily_cases("lognormal-6-0.04", "half are zero-20-0.01")
@pytest.mark.parametrize(("n_worlds", "gain"), [(6, 0.04), (20, 0.01)])
@pytest.mark.parametrize("kind", SKEWED)
def test_intervals_of_what_is_positive_and_skewed_cover_better_than_students(
    kind: str, n_worlds: int, gain: float
) -> None:
    mean, draw = SKEWED[kind]
    samples = draw(np.random.default_rng(n_worlds), (4000, n_worlds))
    positive, student = (
        [interval(values) for values in samples] for interval in (positive_mean_interval, mean_interval)
    )
    assert covered(mean, positive) > max(0.87, covered(mean, student) + gain)
    assert min(low for _, low, _ in positive) >= 0.0
    assert n_worlds > 6 or sum(low < 0.0 for _, low, _ in student) > 1000
    np.testing.assert_array_equal([found.mean for found in positive], [found.mean for found in student])


@pytest.mark.parametrize("kind", SKEWED)
def test_fewer_worlds_than_cover_have_no_interval(kind: str) -> None:
    """From `MIN_WORLDS` on it holds the mean as often as of six."""
    mean, draw = SKEWED[kind]
    samples = draw(np.random.default_rng(MIN_WORLDS), (4000, MIN_WORLDS))
    results = [known_interval(values, positive=True) for values in samples]
    intervals = [result for result in results if result is not None]
    assert len(intervals) == len(samples)
    assert covered(mean, intervals) > 0.87
    assert np.median([interval.high / interval.mean for interval in intervals if interval.mean]) < 10.0
    for n_worlds in range(MIN_WORLDS):
        assert known_interval([0.1, 0.2, 0.3][:n_worlds], positive=True) is None


def test_narrow_intervals_are_students_and_zeros_have_none() -> None:
    values = np.random.default_rng(2).normal(1.0, 0.05, 20)
    assert positive_mean_interval(values) == pytest.approx(mean_interval(values), rel=5e-4)
    assert not positive_mean_interval(values).is_lopsided
    assert positive_mean_interval([0.0, 0.0, 0.0, 5.0]).is_lopsided
    assert positive_mean_interval([0.0] * MIN_WORLDS) == (0.0, 0.0, 0.0)
    assert positive_mean_interval([1.0, np.inf, 1.0, 2.0])[1:] == (-np.inf, np.inf)
    known = [1.0, 2.0, 3.0, 4.0]
    assert known_interval([np.nan, *known], positive=True) == positive_mean_interval(known)


def test_ratio_interval_of_an_exact_ratio() -> None:
    values = np.array([1.0, 2.0, 5.0])
    assert ratio_interval(3.0 * values, values) == pytest.approx((3.0, 3.0, 3.0))


@pytest.mark.parametrize(
    ("low", "high", "verdict"), [(0.1, 0.3, "better"), (-0.1, 0.3, "tie"), (0.0, 0.2, "tie"), (-0.3, -0.1, "worse")]
)
def test_verdict_of_a_paired_difference(low: float, high: float, verdict: str) -> None:
    assert paired_verdict(Interval((low + high) / 2.0, low, high)) == verdict
