"""Confidence intervals against scipy's, and what they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmg_mj.errors import InputError
from cmg_mj.intervals import Interval, mean_interval, paired_verdict, ratio_interval


def test_mean_interval_is_scipys() -> None:
    values = np.random.default_rng(0).normal(2.0, 0.5, 13)
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert mean_interval(values) == pytest.approx((values.mean(), expected.low, expected.high), rel=1e-12)


def test_mean_interval_covers_the_mean_in_95_percent_of_samples() -> None:
    rng = np.random.default_rng(1)
    hits = [low <= 3.0 <= high for _, low, high in (mean_interval(rng.normal(3.0, 2.0, 6)) for _ in range(2000))]
    assert stats.binomtest(sum(hits), len(hits), 0.95).pvalue > 1e-3


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
