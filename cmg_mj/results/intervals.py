"""Means over worlds with their 95 % intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from cmg_mj.errors import InputError

CONFIDENCE = 0.95

PairedVerdict = Literal["better", "tie", "worse"]


class Interval(NamedTuple):
    """A mean and the ends of its 95 % interval."""

    mean: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half the interval's width."""
        return (self.high - self.low) / 2.0


def mean_interval(values: Sequence[float] | np.ndarray) -> Interval:
    """Student's interval of the mean of independent values.

    Args:
        values: One a world, at least two.

    Returns:
        The mean and its interval; infinite ends if a value is not finite.
    """
    from scipy.special import stdtrit  # scipy.stats would take half a second more

    sample = np.asarray(values, dtype=float)
    if len(sample) < 2:
        raise InputError(f"an interval needs two worlds or more, not {len(sample)}")
    if not np.isfinite(sample).all():
        return Interval(math.nan, -math.inf, math.inf)
    mean = float(sample.mean())
    quantile = float(stdtrit(len(sample) - 1, 0.5 + CONFIDENCE / 2.0))
    half = quantile * float(sample.std(ddof=1)) / math.sqrt(len(sample))
    return Interval(mean, mean - half, mean + half)


def known_interval(values: Sequence[float] | np.ndarray) -> Interval | None:
    """The interval of the mean over the finite values, as of the worlds that stood; None of fewer than two."""
    sample = np.asarray(values, dtype=float)
    known = sample[np.isfinite(sample)]
    return mean_interval(known) if len(known) >= 2 else None


def ratio_interval(numerator: np.ndarray, denominator: np.ndarray) -> Interval:
    """Ratio of two positive quantities of the same worlds: the geometric mean of the worlds' ratios.

    Args:
        numerator: One a world, (n_worlds,).
        denominator: The same worlds, (n_worlds,).

    Returns:
        The ratio and its interval, which is symmetric in the logarithm.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        logarithms = np.log(np.asarray(numerator) / np.asarray(denominator))
    return Interval(*(math.exp(value) for value in mean_interval(logarithms)))


def paired_verdict(difference: Interval) -> PairedVerdict:
    """Whether a difference, counted positive for the better, is one beyond chance."""
    if difference.low > 0.0:
        return "better"
    return "worse" if difference.high < 0.0 else "tie"
