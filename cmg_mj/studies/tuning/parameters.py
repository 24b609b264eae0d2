"""Which numbers of an observer can be tuned, and how far each may go. The observer's class declares nothing for it."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cmg_mj.errors import InputError, nearest
from cmg_mj.observers import BENCH_PARAMETERS, Observer, observer_class

SPAN = 1000.0
"""A parameter is searched up to so many times its given value, and down to as small a part of it."""

Make = Callable[..., Observer]
"""Parameters by name -> the observer; raises InputError for what it refuses."""


@dataclass(frozen=True)
class TunedScalar:
    """One number that can be tuned.

    Attributes:
        parameter: The observer's parameter that it is, or is an element of.
        place: Where in it: `(1,)` for the second element, `()` for the parameter itself.
        given: Its value before the tuning, not zero. Its sign is kept.
        low: Smallest size.
        high: Largest size.
    """

    parameter: str
    place: tuple[int, ...]
    given: float
    low: float
    high: float

    @property
    def name(self) -> str:
        """As the user writes it: `tau`, `Q[1]`."""
        return self.parameter + "".join(f"[{i}]" for i in self.place)


def parameters_of(kind: str, observer: Observer, given: Mapping[str, Any]) -> dict[str, Any]:
    """An observer's parameters with the values it has.

    Args:
        kind: Its name.
        observer: The observer.
        given: What it was constructed from.

    Returns:
        Values by name; without those that cannot be read off the observer.
    """
    signature = inspect.signature(observer_class(kind)).parameters.values()
    defaults = {p.name: p.default for p in signature if p.name not in BENCH_PARAMETERS}
    values = {name: getattr(observer, name, default) for name, default in {**defaults, **given}.items()}
    return {name: _plain(value) for name, value in values.items() if value is not inspect.Parameter.empty}


def _plain(value: Any) -> Any:
    """Arrays and lists as tuples."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    return tuple(_plain(item) for item in value) if isinstance(value, (list, tuple)) else value


def replaced(values: Mapping[str, Any], numbers: Sequence[TunedScalar], sizes: Sequence[float]) -> dict[str, Any]:
    """The parameters with other sizes for some numbers."""
    changed = dict(values)
    for number, size in zip(numbers, sizes, strict=True):
        changed[number.parameter] = _put(
            changed[number.parameter], number.place, math.copysign(float(size), number.given)
        )
    return changed


def _put(value: Any, place: tuple[int, ...], new: float) -> Any:
    if not place:
        return new
    return tuple(_put(item, place[1:], new) if i == place[0] else item for i, item in enumerate(value))


def numbers_of(kind: str, values: Mapping[str, Any], make: Make, chosen: Sequence[str] = ()) -> list[TunedScalar]:
    """The numbers to tune: every real number that is not zero, also inside tuples.

    Args:
        kind: The observer's name, for messages.
        values: Its parameters.
        make: Constructs it. What it refuses bounds the search.
        chosen: Names of parameters, or of elements such as `Q[1]`; all that there are if none is chosen.

    Returns:
        The numbers.

    Raises:
        InputError: A chosen name is none, or there is nothing to tune.
    """
    whole = {
        p.name
        for p in inspect.signature(observer_class(kind)).parameters.values()
        if p.annotation in (int, bool, "int", "bool")
    }
    found = [
        (name, place, number)
        for name, value in values.items()
        if name not in whole
        for place, number in _leaves(value, ())
    ]
    if not found:
        raise InputError(f"observer {kind} has no number to tune")
    names = {name + "".join(f"[{i}]" for i in place): name for name, place, _ in found}
    for name in chosen:
        if name not in names and name not in names.values():
            allowed = list(dict.fromkeys([*names.values(), *names]))
            raise InputError(f"--parameters {name}: {kind} has no such number to tune; {nearest(name, allowed)}")
    wanted = [
        (name, place, number)
        for (name, place, number), label in zip(found, names, strict=True)
        if not chosen or name in chosen or label in chosen
    ]
    return [_bounded(name, place, number, values, make) for name, place, number in wanted]


def _leaves(value: Any, place: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], float]]:
    if isinstance(value, tuple):
        for i, item in enumerate(value):
            yield from _leaves(item, (*place, i))
    elif isinstance(value, (int, float)) and not isinstance(value, bool) and value != 0.0 and math.isfinite(value):
        yield place, float(value)


def _bounded(name: str, place: tuple[int, ...], given: float, values: Mapping[str, Any], make: Make) -> TunedScalar:
    """Find by bisection how far the observer lets a number go while the others stay."""
    unbounded = TunedScalar(name, place, given, 0.0, math.inf)
    size = abs(given)

    def accepted(candidate: float) -> bool:
        try:
            make(**replaced(values, [unbounded], [candidate]))
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

    return TunedScalar(name, place, given, farthest(size / SPAN), farthest(size * SPAN))


def narrowed(
    numbers: Sequence[TunedScalar], ranges: Mapping[str, tuple[float, float]], option: str
) -> list[TunedScalar]:
    """The same numbers within ranges that the user gave.

    Args:
        numbers: What is tuned.
        ranges: Number -> smallest and largest size.
        option: The option's name, for messages.

    Returns:
        The numbers.

    Raises:
        InputError: A range is of no number that is tuned, or the observer refuses it, or it is empty.
    """
    names = [number.name for number in numbers]
    for name in ranges:
        if name not in names:
            raise InputError(f"{option} {name}: not tuned; {nearest(name, names, 'tuned')}")
    kept = []
    for number in numbers:
        low, high = ranges.get(number.name, (number.low, number.high))
        if not 0.0 < low < high < math.inf:
            given = f"{number.name}={low:g}:{high:g}"
            raise InputError(f"{option} {given}: must be two positive numbers, the smaller first")
        kept.append(replace(number, low=low, high=high))
    return kept
