"""Lets an observer or a law that takes floats alone serve many worlds: a copy of it steps each world by itself."""

from __future__ import annotations

import copy
import functools
import logging
import math
from contextlib import suppress
from typing import Any

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.types import Measurement, feedback_state

WORLDS, SAMPLES = 3, 100
"""Worlds and samples of the trial that shows whether an observer or a law takes arrays."""


def for_worlds(part: Any, signals: int | None = None) -> Any:
    """Return what steps many worlds as a user's observer or law steps one: itself where it takes arrays.

    Args:
        part: The observer or the law.
        signals: The number of the observer's extra signals, which a law is given; None for an observer.

    Returns:
        The part, or a `OneByOne` of it.
    """
    if type(part).__module__.startswith("cmg_mj.") or getattr(part, "arrays", ()):
        return part
    apart = OneByOne(part)
    with np.errstate(all="ignore"), suppress(Exception):  # of a user's code
        alone = _tried(apart, signals)
        with suppress(Exception):
            if np.allclose(_tried(copy.deepcopy(part), signals), alone, rtol=1e-6, equal_nan=True):
                return part
        _say(type(part).__name__)
    return apart


@functools.cache
def _say(name: str) -> None:
    """Say once that a class takes no arrays."""
    logging.getLogger("cmg_mj").warning(
        "%s takes no arrays: many worlds run one by one. To run them together see docs/python.md", name
    )


def _tried(part: Any, signals: int | None) -> np.ndarray:
    """Return estimates or commands of a trial on noise that grows, (SAMPLES, n_signals, WORLDS)."""
    noise = np.random.default_rng(0).standard_normal((SAMPLES, 7 + (signals or 0), WORLDS))
    noise *= np.linspace(0.0, 0.5, SAMPLES)[:, None, None]
    state, results = part.init(Measurement(*noise[0, :3])), []
    for sample in noise:
        fed = [] if signals is None else [feedback_state(sample[4], sample[5], sample[6], tuple(sample[7:]))]
        state, result = part.step(state, Measurement(*sample[:3]), *fed, sample[3])
        results.append([np.reshape(number, WORLDS) for number in (result if signals is None else [result])])
    return np.array(results)


class States(list):
    """The states of an observer or a law, one a world; of a law with an integrator, that of all worlds is `x_e`."""

    @property
    def x_e(self) -> np.ndarray:
        """The integrators, (n_worlds,)."""
        return np.array([state.x_e for state in self])

    def _replace(self, x_e: Scalar) -> States:
        values = np.broadcast_to(x_e, len(self)).tolist()
        return States(state._replace(x_e=value) for state, value in zip(self, values, strict=True))


class OneByOne:
    """Steps an observer or a law in many worlds, each on floats with a copy of its own.

    Args:
        part: The observer or the law.

    Attributes:
        stands_for: The observer or the law.
    """

    def __init__(self, part: Any) -> None:
        self.stands_for = part
        self._copies: list[Any] = []
        self._result: Any = None

    def init(self, y: Measurement) -> States:
        """Return the state of each world at the first sample."""
        self._copies = [copy.deepcopy(self.stands_for) for _ in y.y1]
        return States(part.init(_of(y, world)) for world, part in enumerate(self._copies))

    def step(self, states: States, *inputs: Any) -> tuple[States, Any]:
        """Advance every world by a sample.

        A world that has ended may bring NaN, which a user's code need not take: its results are NaN too.
        """
        after, results = States(), []
        for world, (part, state) in enumerate(zip(self._copies, states, strict=True)):
            given = [_of(value, world) for value in inputs]
            try:
                state, self._result = part.step(state, *given)
                results.append(self._result)
            except Exception:
                if self._result is None or np.isfinite([*given[0], *np.ravel(given[1])]).all():
                    raise
                results.append(np.full(np.shape(self._result), math.nan))
            after.append(state)
        if np.ndim(results[0]) == 0:
            return after, np.array(results)
        return after, tuple(map(np.array, zip(*results, strict=True)))


def _of(value: Any, world: int) -> Any:
    """Return a world's part of a number, or of a tuple of numbers and its attributes, on floats."""
    if not isinstance(value, tuple):
        return value[world].item() if np.ndim(value) else value
    part = tuple.__new__(type(value), [_of(number, world) for number in value])
    for name, number in getattr(value, "__dict__", {}).items():
        setattr(part, name, _of(number, world))
    return part
