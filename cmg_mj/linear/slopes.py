"""Slopes of an observer's or a law's step at rest, taken by differences of the code that runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, raised
from cmg_mj.core.tree import FLOATS, Leaf, numbers, rebuild
from cmg_mj.core.types import Law, Measurement, Observer, feedback_state, reads_gyro

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
REST = (0.0, 0.0, 0.0)
"""Measurement at rest: y1, y2, acceleration."""
MAX_SAMPLES = 40_000
"""Samples after which a state that has not come to rest is given up."""
LOOK_EVERY = 100
"""Samples between two looks at it."""

Step = Callable[..., tuple[Any, Sequence[float]]]
"""A step as a function: state, *inputs -> next state, outputs."""


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
    """Find the slopes of an observer. Inputs: y1, y2, acceleration, u; the gyro if needed. Outputs: its estimate.

    Args:
        observer: The observer.

    Returns:
        The slopes at rest, where all inputs are 0.

    Raises:
        InputError: The observer does not come to rest, has no slope there, or fails.
    """

    def step(state: Any, y1: float, y2: float, acceleration: float, u: float, *gyro: float) -> tuple[Any, Any]:
        return observer.step(state, Measurement(y1, y2, acceleration, *gyro), u)

    gyro = (0.0,) if reads_gyro(observer) else ()
    return _slopes(observer, step, 4 + len(gyro), Measurement(*REST, *gyro))


def law_slopes(law: Law, extra_signals: int) -> Slopes:
    """Find the slopes of a law. Inputs: y1, y2, acceleration, u before, x1, x2, x3, extra signals. Output: u.

    Args:
        law: The law.
        extra_signals: The number of the observer's extra signals, which are fed back too.

    Returns:
        The slopes at rest.

    Raises:
        InputError: The law does not come to rest, has no slope there, or fails.
    """

    def step(state: Any, y1: float, y2: float, acceleration: float, u: float, *fed: float) -> tuple[Any, Any]:
        x1, x2, x3, *extra = fed
        x = feedback_state(x1, x2, x3, tuple(extra))
        state, command = law.step(state, Measurement(y1, y2, acceleration), x, u)
        return state, (command,)

    return _slopes(law, step, 7 + extra_signals, Measurement(*REST))


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


def _slopes(part: Observer | Law, step: Step, inputs: int, y: Measurement) -> Slopes:
    """Find the slopes of a step at rest, from this measurement on, without the states that no output depends on."""
    with np.errstate(all="ignore"):
        try:
            rest = _rest(part.init(y), step, inputs)
            names = ["_".join(filter(None, leaf.path)) for leaf in _floats(rest)]
            sides = [(_one_sided(rest, step, inputs, share), share_off) for share, share_off in STEPS.items()]
        except InputError:
            raise
        except Exception as error:  # whatever a user's code raises
            raise InputError(f"fails near rest: {raised(error)}") from error
    n = len(names)
    (up, down), _ = sides[0]
    J = 0.5 * (up + down)
    kept = needed_states(J[:n, :n], J[n:, :n])
    rows, columns = (np.concatenate([kept, np.ones(more, bool)]) for more in (len(J) - n, inputs))
    J, n = J[rows][:, columns], int(kept.sum())
    size = np.max(np.abs(J), axis=1, initial=0.0, keepdims=True)
    for pair, share_off in sides:
        if not all(np.all(np.abs(side[rows][:, columns] - J) <= share_off * size) for side in pair):
            raise InputError("has no slope at rest")
    return Slopes(tuple(np.array(names, dtype=object)[kept]), J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:])


def _rest(state: Any, step: Step, inputs: int) -> Any:
    """Advance with inputs of zero until nothing changes."""
    still = (0.0,) * inputs
    largest: np.ndarray | float = 0.0
    for k in range(MAX_SAMPLES):
        before = state
        state, _ = step(state, *still)
        if k % LOOK_EVERY == 0:
            earlier, now = (np.array([leaf.value for leaf in _floats(each)]) for each in (before, state))
            if now.shape != earlier.shape or not np.all(np.isfinite(now)):
                break
            largest = np.maximum(largest, np.abs(earlier))
            if np.all(np.abs(now - earlier) <= RESTED * np.abs(now) + GONE * largest):
                return state
    raise InputError("does not come to rest while nothing moves")


def _one_sided(rest: Any, step: Step, inputs: int, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the slopes of next state and outputs to the upper and to the lower side, (n_rows, n_columns) each."""
    at = np.array([*(leaf.value for leaf in _floats(rest)), *[0.0] * inputs])
    n = len(at) - inputs

    def after(numbers: np.ndarray) -> np.ndarray:
        values = numbers.tolist()
        state, outputs = step(rebuild(rest, iter(values[:n]), FLOATS), *values[n:])
        return np.array([*(leaf.value for leaf in _floats(state)), *(float(output) for output in outputs)])

    middle, lengths = after(at), np.where(np.abs(at) > 1e-100, share * np.abs(at), share)
    up, down = ([after(at + move) - middle for move in np.diag(length)] for length in (lengths, -lengths))
    return np.transpose(up) / lengths, np.transpose(down) / -lengths


def _floats(state: Any) -> list[Leaf]:
    return [leaf for leaf in numbers(state) if isinstance(leaf.value, FLOATS)]
