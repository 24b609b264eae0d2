"""The search for the best sizes of some positive numbers: over their logarithms, without derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.stats import qmc

from cmg_mj.features.tuning.parameters import TunedScalar

GRID = 13
"""Points over the range of a single number before the search narrows."""
SCATTER = 8
"""Points a number, scattered around the given ones, of which the best is a second start."""
SCATTER_FACTOR = 30.0
"""The points are scattered up to so many times the given sizes, and down to as small a part."""
TOLERANCE = 5e-3
"""Relative accuracy of the sizes."""
FIRST_STEP = 0.4
"""First step of a search in several dimensions, in the logarithm."""


class StopSearch(Exception):
    """Raised by a loss to end the search."""


Loss = Callable[[Sequence[float]], float]
"""Sizes -> a positive loss; infinite where there is none."""
Height = Callable[[np.ndarray], float]
"""Logarithms of sizes -> logarithm of the loss."""


def insensitive_numbers(
    loss: Loss, numbers: Sequence[TunedScalar], start_loss: float, factor: float = 10.0
) -> list[TunedScalar]:
    """Return the numbers that the loss does not depend on: it is the same to six digits if they change tenfold.

    Args:
        loss: The loss.
        numbers: The candidates.
        start_loss: The loss of the given sizes.
        factor: Factor by which each is changed.

    Returns:
        The numbers that need no tuning.
    """
    insensitive = []
    for i, number in enumerate(numbers):
        sizes = [abs(other.start) for other in numbers]
        changes = []
        for moved in (max(sizes[i] / factor, number.low), min(sizes[i] * factor, number.high)):
            value = loss([*sizes[:i], moved, *sizes[i + 1 :]])
            changes.append(abs(value - start_loss) if math.isfinite(value) else math.inf)
        if math.isfinite(start_loss) and max(changes) <= 1e-6 * start_loss:
            insensitive.append(number)
    return insensitive


def evaluations(dimension: int) -> int:
    """Estimate how often `search` calls the loss, for a progress bar."""
    return GRID + 15 if dimension == 1 else dimension * (SCATTER + 2 * 45)


def search(loss: Loss, numbers: Sequence[TunedScalar], *, starts: int = 2) -> tuple[list[float], float]:
    """Minimise a loss over the sizes of some numbers, each inside its range.

    One number: a grid over the whole range, then Brent's bounded search between the best point's neighbours.
    More: Nelder and Mead's simplex from the given sizes, and from the best of points scattered around them.

    Args:
        loss: The loss. It may raise `StopSearch`: then the best so far is returned.
        numbers: The tuned numbers.
        starts: Number of starts in several dimensions; one is the given sizes alone.

    Returns:
        The best sizes and their loss, which is infinite if there is none.
    """
    low, high = (np.log([getattr(number, end) for number in numbers]) for end in ("low", "high"))
    start = np.clip(np.log([abs(number.start) for number in numbers]), low, high)
    best: tuple[float, np.ndarray] = (math.inf, start)

    def height(point: np.ndarray) -> float:
        nonlocal best
        value = loss([float(size) for size in np.exp(np.clip(point, low, high))])
        value = math.log(value) if math.isfinite(value) and value > 0.0 else math.inf
        if value < best[0]:
            best = (value, np.array(point))
        return value

    with suppress(StopSearch):
        if len(numbers) == 1:
            _search_line(height, float(low[0]), float(high[0]))
        else:
            _search_simplex(height, low, high, start, starts)
    return [float(size) for size in np.exp(np.clip(best[1], low, high))], math.exp(best[0])


def _search_line(height: Height, low: float, high: float) -> None:
    points = np.linspace(low, high, GRID).tolist()
    heights = [height(np.array([point])) for point in points]
    lowest = int(np.argmin(heights))
    around = points[max(lowest - 1, 0)], points[min(lowest + 1, len(points) - 1)]
    # The search fits parabolas: where there is no loss it is told a number.
    top = max((value for value in heights if math.isfinite(value)), default=0.0) + 1.0
    minimize_scalar(
        lambda point: min(height(np.array([point])), top),
        bounds=around,
        method="bounded",
        options={"xatol": TOLERANCE / 2.0},
    )


def _search_simplex(height: Height, low: np.ndarray, high: np.ndarray, log_sizes: np.ndarray, starts: int) -> None:
    n = len(log_sizes)
    first = [log_sizes]
    if starts > 1:
        reach = math.log(SCATTER_FACTOR)
        floor, ceiling = np.maximum(low, log_sizes - reach), np.minimum(high, log_sizes + reach)
        # `seed` is what every scipy takes; the name `rng` is known from 1.15 on.
        cube = qmc.LatinHypercube(n, seed=np.random.default_rng(0))  # pyright: ignore[reportCallIssue]
        unit = cube.random(SCATTER * n)
        scattered = floor + unit * (ceiling - floor)
        order = np.argsort([height(point) for point in scattered], kind="stable")
        first += [scattered[i] for i in order[: starts - 1]]
    for start in first:
        steps = np.where(start + FIRST_STEP <= high, FIRST_STEP, -np.minimum(FIRST_STEP, start - low))
        corners = np.vstack([start, *(start + step * axis for step, axis in zip(steps, np.eye(n), strict=True))])
        minimize(
            height,
            start,
            method="Nelder-Mead",
            bounds=list(zip(low, high, strict=True)),
            options={"initial_simplex": corners, "xatol": TOLERANCE, "fatol": 1e-5, "maxfev": 120 * n},
        )


def crossing(x: Sequence[float], y: Sequence[float]) -> float | None:
    """Return where a piecewise straight line through (x, y) first crosses zero; None if it does not."""
    for (x0, y0), (x1, y1) in pairwise(zip(x, y, strict=True)):
        if y0 == 0.0:
            return x0
        if y0 * y1 < 0.0:
            return x0 - y0 * (x1 - x0) / (y1 - y0)
    return x[-1] if y[-1] == 0.0 else None
