"""The numbers of an observer that can be tuned, their ranges, and the search for the best of them."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.stats import qmc

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.core.tree import numbers, rebuild
from cmg_mj.observers import OBSERVER_CLASSES, Observer
from cmg_mj.observers.parameter_options import ParameterValue

SPAN = 1000.0
"""Range of the search: from the given value divided by this to the given value times this."""

NUMERIC = (int, float, tuple, list)
"""Types of the parameters that hold numbers."""

MakeObserver = Callable[..., Observer]
"""Makes an observer from its parameters; raises InputError for those that it refuses."""
ParameterValues = Mapping[str, ParameterValue]
"""Parameter -> value."""


@dataclass(frozen=True)
class TunedScalar:
    """One number that can be tuned.

    Attributes:
        name: Name as the user writes it: `tau`, `Q[1]`.
        start: Its value before the tuning, not zero. Its sign is kept.
        low: Smallest size.
        high: Largest size.
    """

    name: str
    start: float
    low: float = 0.0
    high: float = math.inf

    @property
    def parameter(self) -> str:
        """The observer's parameter that contains the number."""
        return self.name.partition("[")[0]


def parameters_of(kind: str, observer: Observer, arguments: ParameterValues) -> dict[str, ParameterValue]:
    """Return an observer's parameters with their values.

    Args:
        kind: The observer's name.
        observer: The observer.
        arguments: Parameters that it was constructed from.

    Returns:
        Name -> value, without those that cannot be read off the observer.
    """
    signature = OBSERVER_CLASSES.takes(kind).values()
    defaults = {p.name: p.default for p in signature if p.name not in OBSERVER_CLASSES.bench_parameters}
    values = {name: getattr(observer, name, default) for name, default in {**defaults, **arguments}.items()}
    known = {name: value for name, value in values.items() if value is not inspect.Parameter.empty}
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in known.items()}


def _scalars(values: ParameterValues) -> dict[str, float]:
    """Return all numbers in numeric parameters, by the names that users write."""
    return {path[0] + "".join(f"[{i}]" for i in path[1:]): value for path, value in numbers(values)}


def replaced(values: ParameterValues, sizes: Mapping[str, float]) -> dict[str, ParameterValue]:
    """Return the parameters with other sizes for some numbers, whose signs stay."""
    numeric = {name: value for name, value in values.items() if isinstance(value, NUMERIC)}
    changed = [math.copysign(sizes[n], value) if n in sizes else value for n, value in _scalars(numeric).items()]
    return {**values, **rebuild(numeric, iter(changed))}


def numbers_of(
    kind: str,
    values: ParameterValues,
    make: MakeObserver,
    chosen: Sequence[str],
    ranges: Mapping[str, tuple[float, float]],
) -> list[TunedScalar]:
    """Return the numbers to tune: every real number that is not zero, also inside tuples.

    Args:
        kind: The observer's name, for messages.
        values: Its parameters.
        make: Makes the observer; the values that it refuses bound the search.
        chosen: Names of parameters, or of elements such as `Q[1]`; by default all.
        ranges: Number -> smallest and largest size, in place of the observer's own bounds.

    Returns:
        The numbers.

    Raises:
        InputError: A chosen name does not exist, there is nothing to tune, or a range belongs to no tuned number or is
            empty.
    """
    integers = {p.name for p in OBSERVER_CLASSES.takes(kind).values() if p.annotation in (int, bool, "int", "bool")}
    real = {name: v for name, v in values.items() if name not in integers and isinstance(v, NUMERIC)}
    candidates = [
        TunedScalar(name, float(start))
        for name, start in _scalars(real).items()
        if not isinstance(start, bool) and start and math.isfinite(start)
    ]
    if not candidates:
        raise InputError(f"observer {kind} has no number to tune")
    allowed = {name for number in candidates for name in (number.parameter, number.name)}
    for name in chosen:
        if name not in allowed:
            raise InputError(f"--parameters {name}: {kind} has no such number to tune; {nearest(name, allowed)}")
    tuned = {n.name: n for n in candidates if not chosen or n.parameter in chosen or n.name in chosen}
    for name, (low, high) in ranges.items():
        if name not in tuned:
            raise InputError(f"--range {name}: not tuned; {nearest(name, tuned, 'tuned')}")
        if not 0.0 < low < high < math.inf:
            raise InputError(f"--range {name}={low:g}:{high:g}: must be two positive numbers, the smaller first")
    bounds = {name: ranges.get(name) or _accepted_range(number, values, make) for name, number in tuned.items()}
    return [replace(number, low=bounds[name][0], high=bounds[name][1]) for name, number in tuned.items()]


def _accepted_range(number: TunedScalar, values: ParameterValues, make: MakeObserver) -> tuple[float, float]:
    """Find by bisection the range of a number that the observer accepts while the others stay."""
    size = abs(number.start)

    def accepted(candidate: float) -> bool:
        try:
            make(**replaced(values, {number.name: candidate}))
        except InputError:
            return False
        return True

    def farthest(end: float) -> float:
        if accepted(end):
            return end
        inside, outside = size, end
        for _ in range(60):
            middle = math.sqrt(inside * outside)
            inside, outside = (middle, outside) if accepted(middle) else (inside, middle)
        return inside

    return farthest(size / SPAN), farthest(size * SPAN)


def plain(parameters: ParameterValues) -> dict[str, ParameterValue]:
    """Return parameters as JSON and TOML can hold them."""
    return {k: v if isinstance(v, (str, *NUMERIC)) else str(v) for k, v in parameters.items() if v is not None}


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


def insensitive_numbers(loss: Loss, numbers: Sequence[TunedScalar], start_loss: float) -> list[TunedScalar]:
    """Return the numbers that the loss does not depend on: it is the same to six digits if they change tenfold."""
    given = [abs(number.start) for number in numbers]

    def change(i: int, size: float) -> float:
        value = loss([*given[:i], size, *given[i + 1 :]])
        return abs(value - start_loss) if math.isfinite(value) else math.inf

    return [
        number
        for i, number in enumerate(numbers)
        if max(change(i, max(given[i] / 10.0, number.low)), change(i, min(given[i] * 10.0, number.high)))
        <= 1e-6 * start_loss
        < math.inf
    ]


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
        starts: 2 starts in several dimensions, or 1, the given sizes alone.

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
        if len(numbers) > 1:
            firsts = [start]
            if starts > 1:
                reach = math.log(SCATTER_FACTOR)
                floor, ceiling = np.maximum(low, start - reach), np.minimum(high, start + reach)
                # `seed` is what every scipy takes; the name `rng` is known from 1.15 on.
                cube = qmc.LatinHypercube(len(start), seed=np.random.default_rng(0))  # pyright: ignore[reportCallIssue]
                scattered = floor + cube.random(SCATTER * len(start)) * (ceiling - floor)
                firsts.append(min(scattered, key=height))
            for first in firsts:
                steps = np.where(first + FIRST_STEP <= high, FIRST_STEP, -np.minimum(FIRST_STEP, first - low))
                corners = np.vstack([first, first + np.diag(steps)])
                minimize(
                    height,
                    first,
                    method="Nelder-Mead",
                    bounds=list(zip(low, high, strict=True)),
                    options={
                        "initial_simplex": corners,
                        "xatol": TOLERANCE,
                        "fatol": 1e-5,
                        "maxfev": 120 * len(numbers),
                    },
                )
        else:
            points = np.linspace(low, high, GRID)
            heights = [height(point) for point in points]
            lowest = int(np.argmin(heights))
            # The search fits parabolas: where there is no loss it is told a number.
            top = max(filter(math.isfinite, heights), default=0.0) + 1.0
            minimize_scalar(
                lambda point: min(height(np.array([point])), top),
                bounds=(points[max(lowest - 1, 0), 0], points[min(lowest + 1, GRID - 1), 0]),
                method="bounded",
                options={"xatol": TOLERANCE / 2.0},
            )
    return [float(size) for size in np.exp(np.clip(best[1], low, high))], math.exp(best[0])


def crossing(x: Sequence[float], y: Sequence[float]) -> float | None:
    """Return where a piecewise straight line through (x, y) first crosses zero; None if it does not."""
    for (x0, y0), (x1, y1) in pairwise(zip(x, y, strict=True)):
        if y0 == 0.0:
            return x0
        if y0 * y1 <= 0.0:
            return x0 - y0 * (x1 - x0) / (y1 - y0)
    return None
