"""A user's observers: some that can be exported, and some that cannot."""

from __future__ import annotations

import math
import random
from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve

from cmg_mj.core.arrays import clip, exp, sign, signed_power, sin, sqrt, where
from cmg_mj.observers import Measurement


class Plain:
    """x1' = x2 + l1 e, x2' = l2 e: the simplest that there is."""

    def __init__(self, dt: float, model: Any, l1: float = 60.0, l2: float = 1600.0) -> None:
        self.dt, self.l1, self.l2 = dt, l1, l2

    def init(self, y: Measurement) -> Any:
        return y.y1, 0.0

    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        x1, x2 = state
        e = y.y1 - x1
        x1, x2 = x1 + self.dt * (x2 + self.l1 * e), x2 + self.dt * self.l2 * e
        return (x1, x2), (x1, x2, y.y2)


class Restless(NamedTuple):
    """A state of all that may be in one."""

    samples: int
    moving: bool
    parts: dict[str, Any]
    last: Measurement
    double: float
    label: str = "a constant"
    unused: Any = None


@dataclass(frozen=True)
class Part:
    int: float
    other: list[float]


class Elaborate(Plain):
    """Functions of elementwise, nested state, integers, truths, extra signals, a docstring with */ and /* in it."""

    extra_signals = ("estimates", "bias_rad", "h")

    def init(self, y: Measurement) -> Restless:
        return Restless(0, False, {"π": Part(y.y1, [0.0, 0.0])}, y, 0.0)

    def step(self, state: Restless, y: Measurement, u: float) -> tuple[Restless, Any]:
        part = state.parts["π"]
        (x1, x2), _ = super().step((part.int, part.other[0]), y, u)
        jump = clip(signed_power(y.y1 - state.last.y1, 0.7), -0.1, 0.1)
        fast = (abs(x2) > 0.2) | (state.samples < 3)
        size = where(fast, sqrt(1.0 + x2 * x2), exp(-abs(x2)))
        trace = 0.9 * part.other[1] + sin(size) * sign(jump) + 1e-3 * y.acceleration + state.moving * 0.01
        result = Restless(state.samples + 1, fast, {"π": Part(x1, [x2, trace])}, y, jump + u)
        return result, (x1, x2 + 1e-3 * trace, y.y2, state.double, trace / (state.samples + 1), size)


class Tilts(Plain):
    """Estimates the tilt alone, somehow."""

    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        return state, (self.tilt(y), 0.0, y.y2)

    def tilt(self, y: Measurement) -> Any:
        return y.y1


class Branches(Tilts):
    def tilt(self, y: Measurement) -> Any:
        if y.y1 > 0.1:  # here
            return 0.1
        return y.y1


class TakesMath(Tilts):
    def tilt(self, y: Measurement) -> Any:
        return math.sin(y.y1)  # here


class Inverts(Tilts):
    def tilt(self, y: Measurement) -> Any:
        return (np.linalg.inv([[y.y1 + 1.0, 0.0], [0.0, 1.0]]) @ [y.y1, 0.0])[0]  # here


class Solves(Tilts):
    def tilt(self, y: Measurement) -> Any:
        return solve([[y.y1 + 1.0]], [y.y1])[0]  # here


class TakesModulo(Tilts):
    def tilt(self, y: Measurement) -> Any:
        return y.y1 % 1.0  # here


class FillsAnArray(Tilts):
    def tilt(self, y: Measurement) -> Any:
        x = np.zeros(2)
        x[0] = y.y1  # here
        return x[0]


class Raises(Tilts):
    def tilt(self, y: Measurement) -> Any:
        if type(y.y1) is not float:
            raise KeyError("floats only")  # here
        return y.y1


class LooksAtTypes(Plain):
    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        state, (x1, x2, x3) = super().step(state, y, u)
        return state, (x1, x2 if isinstance(x2, float) else x2 * 1.0001, x3)


class Remembers(Plain):
    def init(self, y: Measurement) -> Any:
        self.last = y.y1
        return ()

    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        rate, self.last = (y.y1 - self.last) / self.dt, y.y1
        return (), (y.y1, rate, y.y2)


class RemembersInAGlobal(Plain):
    first: list[Any] = []  # noqa: RUF012  (of the class, so that it outlives the observer)

    def init(self, y: Measurement) -> Any:
        self.first.append(y.y1)
        return ()

    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        rate = (y.y1 - self.first[0]) / self.dt
        return (), (y.y1, rate, y.y2)


class RemembersForNothing(Plain):
    def init(self, y: Measurement) -> Any:
        self.last = y.y1
        return super().init(y)

    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        self.change = y.y1 - self.last
        self.last = y.y1
        return super().step(state, y, u)


class Counts(Plain):
    samples = 0

    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        self.samples += 1
        state, (x1, x2, x3) = super().step(state, y, u)
        return state, (x1, x2 + 1e-6 * self.samples, x3)


class DrawsLots(Plain):
    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        state, (x1, x2, x3) = super().step(state, y, u)
        return state, (x1, x2 + random.random(), x3)


class Grows(Plain):
    def init(self, y: Measurement) -> Any:
        return [y.y1]

    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        return [*state, y.y1], (y.y1, y.y1 - state[0], y.y2)


class HoldsADeque(Tilts):
    def init(self, y: Measurement) -> Any:
        return deque([y.y1])


class HoldsTooMuch(Tilts):
    def init(self, y: Measurement) -> Any:
        return np.zeros((40, 40)) + y.y1


class Blows(Plain):
    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        return (1e3 * state[0] + 1.0, 0.0), (state[0] * state[0], 0.0, y.y2)


class BeginsAtInfinity(Plain):
    """The least error so far."""

    def init(self, y: Measurement) -> Any:
        return {"x": super().init(y), "least": math.inf}

    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        x, estimate = super().step(state["x"], y, u)
        least = where(state["least"] < 1e-3, state["least"], np.inf)
        return {"x": x, "least": least}, (estimate[0], estimate[1] + where(least < 1e-3, least, 0.0), estimate[2])


class Stateless(Plain):
    """The accelerometers' tilt and nothing else."""

    def init(self, y: Measurement) -> Any:
        return ()

    def step(self, state: Any, y: Measurement, u: float) -> tuple[Any, Any]:
        return (), (y.y1, 0.01 * y.acceleration, y.y2)
