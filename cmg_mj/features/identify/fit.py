"""Least squares over one log: robust, with what is known before, and with errors that hold for coloured residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

UNTOLD = 0.8
"""An error that is hardly below what was known before: the log does not tell the parameter."""
APART = 0.95
"""Correlation of two parameters' errors from which a log cannot tell both apart."""
BLOCKS = 30
"""Stretches of a log whose scatter shows the errors."""
PASSES = 4
"""Fits, each with the weights that the one before shows."""
USUAL = 3.0
"""Residuals beyond so many standard deviations, as of blows and clipped sensors, count less."""


class Parameter(NamedTuple):
    """A parameter to fit, and what is known of it before: a mean and a standard deviation."""

    name: str
    unit: str
    start: float
    before: float
    known: float = 0.0


class Number(NamedTuple):
    """A fitted parameter."""

    name: str
    unit: str
    value: float
    error: float
    """Half its 95 % interval."""
    told: bool
    """Whether the log tells it, or only what was known before."""
    beside: str = ""
    """A parameter that the log cannot tell apart from it."""


class Solution(NamedTuple):
    """Fitted parameters."""

    numbers: list[Number]
    values: np.ndarray
    """(n_parameters,)"""
    covariance: np.ndarray
    """(n_parameters, n_parameters)"""
    residuals: np.ndarray
    """(n_times, n_channels)"""
    sigmas: np.ndarray
    """Standard deviations of the residuals, without the unusual ones, (n_channels,)."""


def solve(parameters: Sequence[Parameter], residuals: Callable[[np.ndarray], np.ndarray], share: float) -> Solution:
    """Fit parameters to residuals, with what is known before as further residuals.

    Each pass weighs the channels by the inverse of their residuals. A time whose largest residual r is unusual has a
    weight of 1/r^2, so that a push or a blow hardly counts (weights that fall to zero: A. E. Beaton, J. W. Tukey, "The
    fitting of power series", Technometrics 16, 1974).

    Residuals of a low-passed log are correlated: the slopes of the sum of squares over stretches of the log scatter
    more than those of independent residuals. By this ratio the log weighs less against what is known before (L. Pace,
    A. Salvan, N. Sartori, "Adjusting composite likelihood ratio statistics", Statistica Sinica 21, 2011). The errors
    are the sandwich of this scatter (H. White, "Maximum likelihood estimation of misspecified models", Econometrica 50,
    1982), or those of the weighed residuals if they are larger.

    Args:
        parameters: The parameters.
        residuals: Values (n_parameters,) -> residuals, (n_times, n_channels).
        share: Largest share of the times that count as independent.

    Returns:
        The parameters that fit best.
    """
    from scipy.optimize import least_squares

    before, known = np.array([p.before for p in parameters]), np.array([p.known for p in parameters])
    values, n, largest = np.array([p.start for p in parameters]), len(parameters), share

    def weighed(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        return np.concatenate([(weights * residuals(values)).ravel(), (values - known) / before])

    covariance, inverse, sigmas = np.eye(n), np.eye(n), np.ones(1)
    for _ in range(PASSES):
        rest = residuals(values)
        sigmas = 1.4826 * np.median(np.abs(rest), axis=0) + 1e-12
        unusual = np.max(np.abs(rest / sigmas), axis=1, keepdims=True)
        weights = np.sqrt(share) * np.minimum(1.0, USUAL / np.maximum(unusual, 1e-9)) / sigmas
        options = {
            "method": "lm",
            "x_scale": np.minimum(before, np.maximum(np.abs(values), 1e-3)),
            "xtol": 1e-6,
            "ftol": 1e-6,
        }
        found = least_squares(weighed, values, args=(weights,), **options)
        values, slopes = found.x, found.jac[:-n]
        inverse = np.linalg.inv(found.jac.T @ found.jac)
        stretches = zip(np.array_split(slopes, BLOCKS), np.array_split(found.fun[:-n], BLOCKS), strict=True)
        scatter = BLOCKS * np.atleast_2d(np.cov(np.array([s.T @ r for s, r in stretches]).T))
        covariance = inverse @ (scatter + np.diag(before**-2.0)) @ inverse
        ratio = float(np.trace(inverse @ scatter)) / float(np.trace(inverse @ slopes.T @ slopes))
        share = min(largest, share / ratio)
    sizes = np.sqrt(np.maximum(np.diag(covariance), np.diag(inverse)))
    alike = np.abs(covariance) / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance))) - np.eye(n)
    numbers = [
        Number(
            p.name,
            p.unit,
            float(value),
            float(within(size)),
            bool(size < UNTOLD * p.before),
            parameters[row.argmax()].name if row.max() > APART else "",
        )
        for p, value, size, row in zip(parameters, values, sizes, alike, strict=True)
    ]
    return Solution(numbers, values, covariance, residuals(values), sigmas)


def within(sigma: np.ndarray | float) -> np.ndarray | float:
    """Return half the 95 % interval of a standard deviation that comes from `BLOCKS` stretches: Student's."""
    from scipy.special import stdtrit

    return stdtrit(BLOCKS - 1, 0.975) * sigma
