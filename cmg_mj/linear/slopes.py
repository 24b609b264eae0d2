"""Slopes of a step at rest, taken by differences of the code that runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.errors import InputError, raised
from cmg_mj.core.failures import is_trusted
from cmg_mj.core.tree import FLOATS, Leaf, numbers, rebuild
from cmg_mj.core.types import Law, Measurement, Observer, State, feedback_state, reads_gyro

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
TINY = 1e-14
"""A number that is not larger counts as zero: it may be the rounding of gravity."""
REST = (0.0, 0.0, 0.0)
"""Measurement at rest: y1, y2, acceleration."""
MAX_SAMPLES = 40_000
"""Samples after which a state that has not come to rest is given up."""
LOOK_EVERY = 100
"""Samples between two looks at it."""

Step = Callable[..., tuple[Any, Sequence[Scalar]]]
"""A step as a function: state, *inputs -> next state, outputs."""


class Slopes(NamedTuple):
    """A step near rest: next state and outputs by state and inputs.

    Attributes:
        rest: The state at rest; its numbers are the n.
        A: Next state by state, (n, n).
        B: Next state by inputs, (n, n_inputs).
        C: Outputs by state, (n_outputs, n).
        D: Outputs by inputs, (n_outputs, n_inputs).
    """

    rest: State
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    @property
    def paths(self) -> list[tuple[str, ...]]:
        """The path of each number of the state."""
        return [leaf.path for leaf in _floats(self.rest)]


def observer_slopes(observer: Observer) -> Slopes:
    """Find the slopes of an observer. Inputs: y1, y2, acceleration, u; the gyro if needed. Outputs: its estimate.

    Args:
        observer: The observer.

    Returns:
        The slopes at rest, where all inputs are 0.

    Raises:
        InputError: The observer does not come to rest, has no slope there, or fails.
    """

    def step(state: State, y1: Scalar, y2: Scalar, acceleration: Scalar, u: Scalar, *gyro: Scalar) -> tuple[State, Any]:
        return observer.step(state, Measurement(y1, y2, acceleration, *gyro), u)

    gyro = (0.0,) if reads_gyro(observer) else ()
    return _tested(observer, step, 4 + len(gyro), Measurement(*REST, *gyro))


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

    def step(
        state: State, y1: Scalar, y2: Scalar, acceleration: Scalar, u: Scalar, *fed: Scalar
    ) -> tuple[State, Sequence[Scalar]]:
        x1, x2, x3, *extra = fed
        x = feedback_state(x1, x2, x3, tuple(extra))
        state, command = law.step(state, Measurement(y1, y2, acceleration), x, u)
        return state, (command,)

    return _tested(law, step, 7 + extra_signals, Measurement(*REST))


def slopes_at(rest: State, step: Step, inputs: int, share: float = min(STEPS), *, together: bool = False) -> Slopes:
    """Find the slopes of a step at a state.

    Args:
        rest: The state.
        step: The step.
        inputs: The number of its inputs, which are 0.
        share: Length of a difference.
        together: Whether the step takes arrays. Then it is called once, and each difference is a world.

    Returns:
        The slopes: means of those to both sides.
    """
    up, down = _one_sided(rest, step, inputs, share, together)
    return _blocks(rest, 0.5 * (up + down))


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


def _tested(part: Observer | Law, step: Step, inputs: int, y: Measurement) -> Slopes:
    """Find the slopes of a step at rest, from this measurement on, and refuse a step that has none."""
    with np.errstate(all="ignore"):
        try:
            rest = _rest(part.init(y), step, inputs)
            sides = [_one_sided(rest, step, inputs, share, is_trusted(part)) for share in STEPS]
        except InputError:
            raise
        except Exception as error:  # whatever a user's code raises
            raise InputError(f"fails near rest: {raised(error)}") from error
    up, down = sides[0]
    J = 0.5 * (up + down)
    slopes = _blocks(rest, J)
    kept = needed_states(slopes.A, slopes.C)
    rows, columns = (np.concatenate([kept, np.ones(more - len(kept), bool)]) for more in J.shape)
    needed = np.ix_(rows, columns)
    size = np.max(np.abs(J[needed]), axis=1, initial=0.0, keepdims=True)
    for pair, share_off in zip(sides, STEPS.values(), strict=True):
        if not all(np.all(np.abs(side - J)[needed] <= share_off * size) for side in pair):
            raise InputError("has no slope at rest")
    return slopes


def _blocks(rest: State, J: np.ndarray) -> Slopes:
    n = len(_floats(rest))
    return Slopes(rest, J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:])


def _rest(state: State, step: Step, inputs: int) -> State:
    """Advance with inputs of zero until nothing changes."""
    still = (0.0,) * inputs
    largest: np.ndarray | float = 0.0
    for k in range(MAX_SAMPLES):
        before = state
        state, _ = step(state, *still)
        if k % LOOK_EVERY == 0:
            earlier, now = (np.array(_values(each)) for each in (before, state))
            if now.shape != earlier.shape or not np.all(np.isfinite(now)):
                break
            largest = np.maximum(largest, np.abs(earlier))
            if np.all(np.abs(now - earlier) <= RESTED * np.abs(now) + GONE * largest):
                return state
    raise InputError("does not come to rest while nothing moves")


def _one_sided(rest: State, step: Step, inputs: int, share: Scalar, together: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the slopes of next state and outputs to the upper and to the lower side, (n_rows, n_columns) each."""
    at = np.array([*_values(rest), *[0.0] * inputs])
    n = len(at) - inputs
    worlds = (np.ndarray,) if together else ()

    def after(values: Sequence[Any]) -> list[Any]:
        state, outputs = step(rebuild(rest, iter(values[:n]), FLOATS), *values[n:])
        return [*_values(state, worlds), *outputs]

    wanted = share * np.where(np.abs(at) > TINY, np.abs(at), 1.0)
    lengths = (at + wanted) - at  # as they are rounded
    moves = np.diag(lengths)
    moved = at[:, None] + np.hstack([0.0 * moves[:, :1], moves, -moves])
    if together:
        ends = np.vstack([value + 0.0 * moved[0] for value in after([*moved])])
    else:
        ends = np.transpose([after(column) for column in moved.T.tolist()])
    up, down = np.hsplit(ends[:, 1:] - ends[:, :1], 2)
    return up / lengths, down / -lengths


def _floats(state: State, worlds: tuple[type, ...] = ()) -> list[Leaf]:
    return [leaf for leaf in numbers(state, worlds=worlds) if isinstance(leaf.value, (*FLOATS, *worlds))]


def _values(state: State, worlds: tuple[type, ...] = ()) -> list[Any]:
    return [leaf.value for leaf in _floats(state, worlds)]
