"""A user's control laws: some that can be exported, and some that cannot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from cmg_mj import FeedbackState, Measurement
from cmg_mj.core.arrays import clip, exp, where


@dataclass(frozen=True)
class Memoryless:
    """-k1 x1 - k2 x2 + x3: neither memory nor a limit of its own."""

    dt: float
    rate_limit: float
    k1: float = 35.0
    k2: float = 4.0

    def init(self, y: Measurement) -> Any:
        return None

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> tuple[Any, Any]:
        return state, -self.k1 * x.x1 - self.k2 * x.x2 + x.x3


class Memory(NamedTuple):
    """A state of all that may be in one."""

    parts: dict[str, Any]
    x_e: Any
    started: bool
    unused: Measurement
    label: str = "a constant"


class Elaborate(Memoryless):
    """Takes whatever there is. */ /* Its integrator does not begin at zero."""

    trim_gain = 100.0

    def init(self, y: Measurement) -> Memory:
        return Memory({"π": [y.y2, 0], "abs": 0.0 * y.acceleration}, 0.1 + y.y2, False, y)

    def step(self, state: Memory, y: Measurement, x: FeedbackState, u: Any) -> tuple[Memory, Any]:
        last, count = state.parts["π"]
        smooth = 0.9 * state.parts["abs"] + 1e-4 * y.acceleration + 1e-3 * sum(x.extra)
        gain = where(state.started & (abs(x.x1) < 0.05), 1.0, exp(-abs(x.x1)))
        demanded = -gain * (self.k1 * x.x1 + self.k2 * x.x2) + x.x3 - 0.3 * state.x_e + clip(smooth, -0.1, 0.1)
        demanded = demanded + 0.01 * u - 0.1 * (y.y2 - last) / (count + 1)
        parts = {"π": [y.y2, count + 1], "abs": smooth}
        return Memory(parts, 0.999 * state.x_e - self.dt * x.x3, abs(x.x2) < 1.0, y), demanded


class InADict(Memoryless):
    """Its x_e is no attribute of its state, and so no integrator that the trajectory shows."""

    def init(self, y: Measurement) -> Any:
        return {"x_e": 0.0 * y.y1}

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> tuple[Any, Any]:
        _, demanded = super().step(None, y, x, u)
        return {"x_e": state["x_e"] - self.dt * x.x3}, demanded - 0.3 * state["x_e"]


class Overflows(Memoryless):
    """Infinite when the rig hangs."""

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> tuple[Any, Any]:
        return state, -1e308 * x.x1 * x.x1 * x.x1


class Branches(Memoryless):
    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> tuple[Any, Any]:
        if x.x1 > 0.1:  # here
            return state, 1.0
        return super().step(state, y, x, u)


class LooksAtTypes(Memoryless):
    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> tuple[Any, Any]:
        return state, super().step(state, y, x, u)[1] * (1.0 if isinstance(x.x1, float) else 1.001)


class BeginsAtInfinity(Memoryless):
    def init(self, y: Measurement) -> Any:
        return {"least": math.inf}

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> tuple[Any, Any]:
        return state, super().step(None, y, x, u)[1] + where(state["least"] < 1e-3, 1.0, 0.0)


class Blows(Memoryless):
    def init(self, y: Measurement) -> Any:
        return 1.0

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> tuple[Any, Any]:
        return 1e6 * state, 1e-300 * state * (1.0 + x.x1)


@dataclass(frozen=True)
class Derived:
    """A state whose integrator is computed."""

    half: Any

    @property
    def x_e(self) -> Any:
        """Twice the half."""
        return 2.0 * self.half


class Derives(Memoryless):
    def init(self, y: Measurement) -> Any:
        return Derived(0.0 * y.y1)

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> tuple[Any, Any]:
        return Derived(state.half - self.dt * x.x3), super().step(None, y, x, u)[1] - 0.1 * state.half
