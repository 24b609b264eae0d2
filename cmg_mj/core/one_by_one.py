"""Lets an observer or a law of the user's, written for floats, serve many worlds: a copy of it steps each by itself."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.types import Measurement


def for_worlds(part: Any) -> Any:
    """Return what steps many worlds as an observer or a law steps one.

    The package's own take arrays. So does a class that says `elementwise = True`, and a law whose `arrays` name
    parameters that differ between worlds.
    """
    takes_arrays = type(part).__module__.startswith("cmg_mj.") or getattr(part, "arrays", ())
    return part if takes_arrays or getattr(part, "elementwise", False) else OneByOne(part)


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
        rate_limit: Largest gimbal rate of a law; none of an observer [rad/s].
    """

    def __init__(self, part: Any) -> None:
        self.stands_for = part
        self.rate_limit = getattr(part, "rate_limit", math.inf)
        self._copies: list[Any] = []
        self._lost: Any = None

    def init(self, y: Measurement) -> States:
        """Return the state of each world at the first sample."""
        self._lost = None
        self._copies = [copy.deepcopy(self.stands_for) for _ in range(np.size(y.y1))]
        return States(part.init(_of(y, world)) for world, part in enumerate(self._copies))

    def step(self, states: States, *inputs: Any) -> tuple[States, Any]:
        """Advance every world by a sample."""
        if not self._copies:  # the states are those of a run before
            self._copies = [copy.deepcopy(self.stands_for) for _ in states]
        after, results = States(states), [self._lost] * len(states)
        for world, part in enumerate(self._copies):
            given = [_of(value, world) for value in inputs]
            try:
                after[world], result = part.step(states[world], *given)
                if self._lost is None:
                    shapes = {np.shape(number) for number in (result if isinstance(result, Sequence) else [result])}
                    if shapes != {()}:
                        raise TypeError(f"step returned numbers of shapes {shapes}, not ()")
                    self._lost = np.full(np.shape(result), math.nan)
                results[world] = result
            except Exception:
                if self._lost is None or math.isfinite(given[0].y1):
                    raise
                results[world] = self._lost  # of a world that has ended, whose samples may be NaN
        if np.shape(self._lost) == ():
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
