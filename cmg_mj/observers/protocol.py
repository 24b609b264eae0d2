"""What an observer is: a frozen value with `init` and `step`, discrete in time, elementwise in the worlds."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, Protocol

from pydantic import ConfigDict, Field

from cmg_mj.elementwise import Scalar

CONFIG = ConfigDict(extra="forbid", arbitrary_types_allowed=True, allow_inf_nan=False)
"""Configuration of the observers' dataclasses: an unknown or unusable parameter is refused."""

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]


class Measurement(NamedTuple):
    """y of aranovskiy2020 (5): floats for one world, arrays (n_worlds,) for many."""

    y1: Scalar
    """Tilt q_b + pi/4 from the accelerometers [rad]."""
    y2: Scalar
    """Gimbal angle q_c - pi/2, half the difference of the two encoders [rad]."""


class Estimate(NamedTuple):
    """An observer's estimate of x at the sample it was given."""

    x1: Scalar
    """Tilt [rad]."""
    x2: Scalar
    """Tilt rate [rad/s]."""
    x3: Scalar
    """Gimbal angle [rad]."""


class Observer(Protocol):
    """A velocity observer in discrete time.

    The estimate at sample k uses y_k (a filter, not a one-step predictor) and the input u held since sample
    k-1. All memory is in the state, so that one observer value serves any number of runs and worlds.
    """

    def init(self, y: Measurement) -> Any:
        """The state at the first sample. The estimate of that sample is (y1, 0, y2)."""
        ...

    def step(self, state: Any, y: Measurement, u: Scalar) -> tuple[Any, Estimate]:
        """Advance by one sample period.

        Args:
            state: The state at sample k-1.
            y: The measurement at sample k.
            u: The gimbal rate commanded at sample k-1 and held since [rad/s].

        Returns:
            The state and the estimate at sample k.
        """
        ...
