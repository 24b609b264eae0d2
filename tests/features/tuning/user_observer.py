"""A user's own observer to tune, and a table as it is printed."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.console import Console, RenderableType

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import Estimate


@dataclass(frozen=True)
class UserObserver:
    """A user's observer: a plain dataclass, integers among its numbers, a limit that only its constructor knows."""

    dt: float
    model: ReducedModel
    gain: float = 2
    order: int = 3
    is_on: bool = True
    name: str = "own"

    def __post_init__(self) -> None:
        if self.gain > 10.0:
            raise ValueError("gain: at most 10")

    def init(self, y: Any) -> Any:
        return y.y1

    def step(self, state: Any, y: Any, u: Any) -> tuple[Any, Estimate]:
        rate = self.gain * (y[0] - state) / self.dt
        if self.gain < 0.05:
            raise RuntimeError("lost")
        if self.gain > 5.0:  # loses itself where the push takes it, which no rehearsal finds
            rate = rate * np.where(np.abs(y[0]) > 0.02, math.nan, 1.0)
        return y[0], Estimate(y[0], rate, y[1])


USER_OBSERVER = f"{__name__}:UserObserver"


def printed(table: RenderableType) -> str:
    """A table and its text, on lines that are not broken."""
    console = Console(file=(text := io.StringIO()), width=400)
    console.print(table)
    return text.getvalue()
