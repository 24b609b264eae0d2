"""The numbers of an observer that can be tuned, and their ranges; the observer's class declares nothing for it."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.observers import OBSERVER_CLASSES, Observer
from cmg_mj.observers.parameter_options import ParameterValue

SPAN = 1000.0
"""Range of the search: from the given value divided by this to the given value times this."""

MakeObserver = Callable[..., Observer]
"""Makes an observer from its parameters; raises InputError for those that it refuses."""
ParameterValues = Mapping[str, ParameterValue]
"""Parameter -> value."""


@dataclass(frozen=True)
class TunedScalar:
    """One number that can be tuned.

    Attributes:
        parameter: The observer's parameter that contains the number.
        place: Indices in the parameter: `(1,)` for the second element, `()` for the parameter itself.
        start: Its value before the tuning, not zero. Its sign is kept.
        low: Smallest size.
        high: Largest size.
    """

    parameter: str
    place: tuple[int, ...]
    start: float
    low: float
    high: float

    @property
    def name(self) -> str:
        """Name as the user writes it: `tau`, `Q[1]`."""
        return self.parameter + "".join(f"[{i}]" for i in self.place)


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
    return {name: _as_tuples(value) for name, value in values.items() if value is not inspect.Parameter.empty}


def _as_tuples(value: ParameterValue | np.ndarray) -> ParameterValue:
    """Convert arrays and lists to tuples."""
    if isinstance(value, np.ndarray):
        return _as_tuples(value.tolist())
    return tuple(_as_tuples(item) for item in value) if isinstance(value, (list, tuple)) else value


def replaced(
    values: ParameterValues, numbers: Sequence[TunedScalar], sizes: Sequence[float]
) -> dict[str, ParameterValue]:
    """Return the parameters with other sizes for some numbers."""
    changed = dict(values)
    for number, size in zip(numbers, sizes, strict=True):
        changed[number.parameter] = _put(
            changed[number.parameter], number.place, math.copysign(float(size), number.start)
        )
    return changed


def _put(value: ParameterValue, place: tuple[int, ...], new: float) -> ParameterValue:
    if not place or not isinstance(value, Sequence):
        return new
    return tuple(_put(item, place[1:], new) if i == place[0] else item for i, item in enumerate(value))


def numbers_of(kind: str, values: ParameterValues, make: MakeObserver, chosen: Sequence[str] = ()) -> list[TunedScalar]:
    """Return the numbers to tune: every real number that is not zero, also inside tuples.

    Args:
        kind: The observer's name, for messages.
        values: Its parameters.
        make: Makes the observer; the values that it refuses bound the search.
        chosen: Names of parameters, or of elements such as `Q[1]`; by default all.

    Returns:
        The numbers.

    Raises:
        InputError: A chosen name does not exist, or there is nothing to tune.
    """
    integers = {p.name for p in OBSERVER_CLASSES.takes(kind).values() if p.annotation in (int, bool, "int", "bool")}
    candidates = [
        TunedScalar(name, place, number, 0.0, math.inf)
        for name, value in values.items()
        if name not in integers
        for place, number in _leaves(value, ())
    ]
    if not candidates:
        raise InputError(f"observer {kind} has no number to tune")
    allowed = {name for number in candidates for name in (number.parameter, number.name)}
    for name in chosen:
        if name not in allowed:
            raise InputError(f"--parameters {name}: {kind} has no such number to tune; {nearest(name, allowed)}")
    return [
        _bounded(number, values, make)
        for number in candidates
        if not chosen or number.parameter in chosen or number.name in chosen
    ]


def _leaves(value: ParameterValue, place: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], float]]:
    if isinstance(value, tuple):
        for i, item in enumerate(value):
            yield from _leaves(item, (*place, i))
    elif isinstance(value, (int, float)) and not isinstance(value, bool) and value != 0.0 and math.isfinite(value):
        yield place, float(value)


def _bounded(number: TunedScalar, values: ParameterValues, make: MakeObserver) -> TunedScalar:
    """Find by bisection the range of a number that the observer accepts while the others stay."""
    size = abs(number.start)

    def accepted(candidate: float) -> bool:
        try:
            make(**replaced(values, [number], [candidate]))
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

    return replace(number, low=farthest(size / SPAN), high=farthest(size * SPAN))


def narrowed(
    numbers: Sequence[TunedScalar], ranges: Mapping[str, tuple[float, float]], option: str
) -> list[TunedScalar]:
    """Narrow numbers to the user's ranges.

    Args:
        numbers: The tuned numbers.
        ranges: Number -> smallest and largest size.
        option: The option's name, for messages.

    Returns:
        The numbers.

    Raises:
        InputError: A range belongs to no tuned number, or is empty.
    """
    names = [number.name for number in numbers]
    for name in ranges:
        if name not in names:
            raise InputError(f"{option} {name}: not tuned; {nearest(name, names, 'tuned')}")
    bounded = []
    for number in numbers:
        low, high = ranges.get(number.name, (number.low, number.high))
        if not 0.0 < low < high < math.inf:
            limits = f"{number.name}={low:g}:{high:g}"
            raise InputError(f"{option} {limits}: must be two positive numbers, the smaller first")
        bounded.append(replace(number, low=low, high=high))
    return bounded


def plain(parameters: ParameterValues) -> dict[str, ParameterValue]:
    """Return parameters as JSON and TOML can hold them."""
    return {name: _listed(value) for name, value in parameters.items() if value is not None}


def _listed(value: ParameterValue) -> ParameterValue:
    """Convert tuples to lists, and what JSON or TOML cannot hold to text."""
    if isinstance(value, tuple):
        return [_listed(item) for item in value]
    return value if isinstance(value, (bool, int, float, str)) else str(value)
