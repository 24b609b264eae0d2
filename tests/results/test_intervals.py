"""Confidence intervals against scipy's, and what they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmg_mj.errors import InputError
from cmg_mj.results.intervals import Interval, known_interval, mean_interval, paired_verdict, ratio_interval
from cmg_mj.studies.sweeps.cells import fell_interval


def test_mean_interval_is_scipys() -> None:
    values = np.random.default_rng(0).normal(2.0, 0.5, 13)
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert mean_interval(values) == pytest.approx((values.mean(), expected.low, expected.high), rel=1e-12)


def test_mean_interval_covers_the_mean_in_95_percent_of_samples() -> None:
    rng = np.random.default_rng(1)
    coverage = [low <= 3.0 <= high for _, low, high in (mean_interval(rng.normal(3.0, 2.0, 6)) for _ in range(2000))]
    assert stats.binomtest(sum(coverage), len(coverage), 0.95).pvalue > 1e-3


TIMES = 10_000
"""Samples of 100 worlds."""


def share_that_holds(mean: float, samples: np.ndarray) -> float:
    """Return the share of the samples, (n_samples, n_worlds), that have the mean in their interval."""
    result = [known_interval(values) for values in samples]
    return float(np.mean([interval is not None and interval.low <= mean <= interval.high for interval in result]))


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


def test_paired_differences_cover_and_are_narrower() -> None:
    """Two observers with the same noise: errors correlated by 0.95, whose means are 0.02 apart."""
    rng = np.random.default_rng(8)
    common = rng.normal(0.0, 1.0, (TIMES, 100))
    first, second = (
        mean + 0.3 * (np.sqrt(0.95) * common + np.sqrt(0.05) * rng.normal(0.0, 1.0, common.shape))
        for mean in (1.0, 1.02)
    )
    assert 0.925 <= share_that_holds(0.02, second - first) <= 0.975
    paired, alone = known_interval(second[0] - first[0]), known_interval(first[0])
    assert paired is not None
    assert alone is not None
    assert paired.half < 0.5 * alone.half


@pytest.mark.parametrize("worlds", [100, 400])
@pytest.mark.parametrize("share", [0.05, 0.2, 0.5])
def test_the_share_of_falls_is_covered(share: float, worlds: int) -> None:
    """Wilson's interval: exactly, by the probability of every count, and in 10,000 samples."""
    low, high = np.array([fell_interval(n_fallen, worlds)[1:] for n_fallen in range(worlds + 1)]).T
    is_covered = (low <= share) & (share <= high)
    exactly = stats.binom.pmf(np.arange(worlds + 1), worlds, share)[is_covered].sum()
    assert 0.925 <= exactly <= 0.975
    n_fallen = np.random.default_rng(9).binomial(worlds, share, TIMES)
    assert 0.925 <= is_covered[n_fallen].mean() <= 0.975
    assert is_covered[n_fallen].mean() == pytest.approx(exactly, abs=0.01)


def test_ratio_interval_of_an_exact_ratio() -> None:
    values = np.array([1.0, 2.0, 5.0])
    assert ratio_interval(3.0 * values, values) == pytest.approx((3.0, 3.0, 3.0))


@pytest.mark.parametrize(
    ("low", "high", "verdict"), [(0.1, 0.3, "better"), (-0.1, 0.3, "tie"), (0.0, 0.2, "tie"), (-0.3, -0.1, "worse")]
)
def test_verdict_of_a_paired_difference(low: float, high: float, verdict: str) -> None:
    assert paired_verdict(Interval((low + high) / 2.0, low, high)) == verdict


def test_one_world_makes_no_interval() -> None:
    with pytest.raises(InputError, match="two worlds or more"):
        mean_interval([1.0])
