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
    """Compute Student's interval of the mean of independent values.

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
    """Compute the interval of the mean over the finite values, as of the worlds that stood; None of fewer than two."""
    known = finite_values(values)
    return mean_interval(known) if len(known) >= 2 else None


def finite_values(values: Sequence[float] | np.ndarray) -> np.ndarray:
    """Discard what is not finite, as of worlds that fell, (n,) -> (n_finite,)."""
    sample = np.asarray(values, dtype=float)
    return sample[np.isfinite(sample)]


def finite_mean(values: Sequence[float] | np.ndarray) -> float | None:
    """Compute the mean over the finite values; None of none."""
    known = finite_values(values)
    return float(known.mean()) if len(known) else None


def ratio_interval(numerator: np.ndarray, denominator: np.ndarray) -> Interval:
    """Compute the geometric mean of the worlds' ratios of two positive quantities.

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
    """Judge whether a difference, counted positive for the better, is one beyond chance."""
    if difference.low > 0.0:
        return "better"
    return "worse" if difference.high < 0.0 else "tie"
