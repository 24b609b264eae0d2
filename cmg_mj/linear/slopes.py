"""Slopes of an observer's or a law's step at rest, taken by differences of the code that runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, raised, shortened
from cmg_mj.core.types import Law, Measurement, Observer, feedback_state

STEPS = {1e-8: 1e-3, 1e-7: 1e-2, 1e-3: 0.6}
"""Length of a difference -> the share of a row's largest slope by which the slopes to both sides may be off.

A length is a share of a number that is not zero at rest, and absolute for zero. Short lengths that agree show a slope.
The long one, 1e-3 rad where the tilt's noise is 6e-3, shows whether it says anything of a motion that is measured: the
sampled `super_twisting`, a finite difference within 2.9e-4 rad, is off by 0.71 there, `high_gain` by 0.53.
"""
RESTED = 1e-9
"""A number rests that changes by less than this share in a sample."""
GONE = 1e-15
"""Or by less than this share of the largest that it was: a trace of the start that fades for ever."""
MOST_SAMPLES = 40_000
"""Samples after which a state that has not come to rest is given up."""
LOOK_EVERY = 100
"""Samples between two looks at it."""

Step = Callable[[Any, Sequence[float]], tuple[Any, Sequence[float]]]
"""A step as a function: state, inputs -> next state, outputs."""


class Slopes(NamedTuple):
    """A step near rest: next state and outputs by state and inputs.

    Attributes:
        names: Name of each number of the state, (n,).
        A: Next state by state, (n, n).
        B: Next state by inputs, (n, n_inputs).
        C: Outputs by state, (n_outputs, n).
        D: Outputs by inputs, (n_outputs, n_inputs).
    """

    names: tuple[str, ...]
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray


def observer_slopes(observer: Observer) -> Slopes:
    """Find the slopes of an observer. Inputs: y1, y2, acceleration, u. Outputs: its estimate.

    Args:
        observer: The observer.

    Returns:
        The slopes at rest, y1 = y2 = u = 0.

    Raises:
        InputError: The observer does not come to rest, has no slope there, or fails.
    """

    def step(state: Any, inputs: Sequence[float]) -> tuple[Any, Sequence[float]]:
        y1, y2, acceleration, u = inputs
        return observer.step(state, Measurement(y1, y2, acceleration), u)

    return _slopes(lambda: observer.init(Measurement(0.0, 0.0, 0.0)), step, 4)


def law_slopes(law: Law, extra_signals: int = 0) -> Slopes:
    """Find the slopes of a law. Inputs: y1, y2, acceleration, u before, x1, x2, x3, extra signals. Output: u.

    Args:
        law: The law.
        extra_signals: The number of the observer's extra signals, which are fed back too.

    Returns:
        The slopes at rest.

    Raises:
        InputError: The law does not come to rest, has no slope there, or fails.
    """

    def step(state: Any, inputs: Sequence[float]) -> tuple[Any, Sequence[float]]:
        y1, y2, acceleration, u, x1, x2, x3, *extra = inputs
        state, command = law.step(state, Measurement(y1, y2, acceleration), feedback_state(x1, x2, x3, tuple(extra)), u)
        return state, (command,)

    return _slopes(lambda: law.init(Measurement(0.0, 0.0, 0.0)), step, 7 + extra_signals)


def needed_states(A: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Find the states that reach an output, however many samples later.

    Args:
        A: State matrix, (n, n).
        C: Output matrix, (n_outputs, n).

    Returns:
        True for each of them, (n,).
    """
    needed = np.any(C != 0.0, axis=0)
    while np.any(more := np.any(A[needed] != 0.0, axis=0) & ~needed):
        needed |= more
    return needed


def _slopes(init: Callable[[], Any], step: Step, inputs: int) -> Slopes:
    """Find the slopes of a step at rest, without the states that no output depends on."""
    with np.errstate(all="ignore"):
        try:
            rest = _rest(init(), step, inputs)
            names = tuple(_names(rest))
            sides = [(_one_sided(rest, step, inputs, share), share_off) for share, share_off in STEPS.items()]
        except InputError:
            raise
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # whatever a user's code raises
            raise InputError(f"fails near rest: {raised(error)}") from error
    n = len(names)
    (up, down), _ = sides[0]
    J = 0.5 * (up + down)
    kept = needed_states(J[:n, :n], J[n:, :n])
    cut = np.ix_(np.concatenate([kept, np.ones(len(J) - n, bool)]), np.concatenate([kept, np.ones(inputs, bool)]))
    J, n = J[cut], int(kept.sum())
    size = np.max(np.abs(J), axis=1, initial=0.0, keepdims=True)
    for pair, share_off in sides:
        if not all(np.all(np.abs(side[cut] - J) <= share_off * size) for side in pair):
            raise InputError("has no slope at rest")
    return Slopes(tuple(np.array(names, dtype=object)[kept]), J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:])


def _rest(state: Any, step: Step, inputs: int) -> Any:
    """Advance with inputs of zero until nothing changes."""
    still = (0.0,) * inputs
    largest: np.ndarray | float = 0.0
    for k in range(MOST_SAMPLES):
        before = state
        state, _ = step(state, still)
        if k % LOOK_EVERY == 0:
            earlier, now = (np.array(list(_numbers(each))) for each in (before, state))
            if now.shape != earlier.shape or not np.all(np.isfinite(now)):
                break
            largest = np.maximum(largest, np.abs(earlier))
            if np.all(np.abs(now - earlier) <= RESTED * np.abs(now) + GONE * largest):
                return state
    raise InputError("does not come to rest while nothing moves")


def _one_sided(rest: Any, step: Step, inputs: int, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the slopes of next state and outputs to the upper and to the lower side, (n_rows, n_columns) each."""
    at = np.array([*_numbers(rest), *[0.0] * inputs])
    n = len(at) - inputs

    def after(numbers: np.ndarray) -> np.ndarray:
        values = numbers.tolist()
        state, outputs = step(_with_numbers(rest, iter(values[:n])), values[n:])
        return np.array([*_numbers(state), *(float(output) for output in outputs)])

    middle, lengths = after(at), np.where(np.abs(at) > 1e-100, share * np.abs(at), share)
    up = [(after(at + move) - middle) / length for move, length in zip(np.diag(lengths), lengths, strict=True)]
    down = [(middle - after(at - move)) / length for move, length in zip(np.diag(lengths), lengths, strict=True)]
    return np.transpose(up), np.transpose(down)


def _parts(value: Any) -> list[tuple[str, Any]]:
    """Return the parts of a state that may hold numbers, by name; none of a number or of what holds none."""
    if isinstance(value, (tuple, list)):
        names = getattr(value, "_fields", None) or (*map(str, range(len(value))),)
        return [*zip(names, value, strict=True), *getattr(value, "__dict__", {}).items()]
    if isinstance(value, dict):
        return [(str(name), part) for name, part in value.items()]
    if isinstance(value, np.ndarray) and value.ndim:
        return [(str(i), part) for i, part in enumerate(value)]
    if dataclasses.is_dataclass(value):
        return [(field.name, getattr(value, field.name)) for field in dataclasses.fields(value)]
    if value is None or isinstance(value, (bool, int, float, str, np.number, np.ndarray)):
        return []
    raise InputError(f"keeps a {shortened(type(value).__name__)} in its state, not numbers in tuples")


def _is_number(value: Any) -> bool:
    return isinstance(value, (float, np.floating)) or (isinstance(value, np.ndarray) and not value.ndim)


def _numbers(state: Any) -> Iterator[float]:
    """The numbers of a state, in order; whole numbers and flags are no part of a linear system."""
    if _is_number(state):
        yield float(state)
    for _, part in _parts(state):
        yield from _numbers(part)


def _names(state: Any, name: str = "") -> Iterator[str]:
    """Name the numbers of a state, parts joined by `_`."""
    if _is_number(state):
        yield name
    for part_name, part in _parts(state):
        yield from _names(part, f"{name}_{part_name}".removeprefix("_"))


def _with_numbers(state: Any, numbers: Iterator[float]) -> Any:
    """Return a state of the same shape with other numbers, in the order of `_numbers`."""
    if _is_number(state):
        return next(numbers)
    parts = {name: _with_numbers(part, numbers) for name, part in _parts(state)}
    if isinstance(state, tuple):
        attributes = getattr(state, "__dict__", {})
        items = [part for name, part in parts.items() if name not in attributes]
        made = tuple.__new__(type(state), items)
        for name in attributes:
            setattr(made, name, parts[name])
        return made
    if isinstance(state, list):
        return list(parts.values())
    if isinstance(state, dict):
        return dict(zip(state, parts.values(), strict=True))
    if isinstance(state, np.ndarray) and state.ndim:
        return np.array(list(parts.values()), dtype=state.dtype)
    return dataclasses.replace(state, **parts) if parts else state  # type: ignore[arg-type]
