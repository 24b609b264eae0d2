"""Velocity observers by name, and a user's own by dotted path."""

from __future__ import annotations

from typing import Any

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import NEEDS, Estimate, Measurement, Observer, needs
from cmg_mj.inputs.user_classes import UserClassKind

__all__ = ["NEEDS", "OBSERVERS", "OBSERVER_CLASSES", "Estimate", "Measurement", "Observer", "make_observer", "needs"]


OBSERVERS = {
    "linear": "cmg_mj.observers.linear:LinearDifferentiator",
    "ltv": "cmg_mj.observers.ltv:LinearTimeVarying",
    "homogeneous": "cmg_mj.observers.homogeneous:Homogeneous",
    "luenberger": "cmg_mj.observers.luenberger:Luenberger",
    "kalman": "cmg_mj.observers.kalman:Kalman",
    "gyro_free": "cmg_mj.observers.gyro_free:GyroFree",
    "free_pivot": "cmg_mj.observers.free_pivot:FreePivot",
    "mems_fused": "cmg_mj.observers.mems_fused:MemsFused",
    "finite_difference": "cmg_mj.observers.linear:FiniteDifference",
    "super_twisting": "cmg_mj.observers.linear:SuperTwisting",
    "linear_high_gain": "cmg_mj.observers.linear:LinearHighGain",
    "high_gain": "cmg_mj.observers.high_gain:HighGain",
    "adaptive": "cmg_mj.observers.adaptive:Adaptive",
    "homogeneous_adaptive": "cmg_mj.observers.homogeneous:HomogeneousAdaptive",
}
"""Name a user types -> dotted path of the class."""

OBSERVER_CLASSES = UserClassKind(
    "observer", "observer", OBSERVERS, ("dt", "model"), ("noise",), {"init": "y", "step": "state, y, u"}
)
"""Finds, checks and makes observers."""


def make_observer(
    kind: str, dt: float, model: ReducedModel, noise: MeasurementNoise | None = None, /, **parameters: Any
) -> Observer:
    """Construct an observer.

    Args:
        kind: A name of `OBSERVERS`, or `package.module:Class`.
        dt: Sample period [s].
        model: The reduced model read off the plant.
        noise: Of tilt and angular acceleration as the sensors' datasheet says, for the observers that take it.
        **parameters: The observer's design parameters; those left out keep their defaults.

    Returns:
        The observer.

    Raises:
        InputError: Unknown observer or parameter, or a parameter that the observer refuses.
    """
    parameter = OBSERVER_CLASSES.takes(kind).get("noise")
    if noise is None and parameter is not None and parameter.default is parameter.empty:
        raise InputError(f"observer {kind}: needs the noise of its sensors (a MeasurementNoise after the model)")
    return OBSERVER_CLASSES.make(kind, {"dt": dt, "model": model, "noise": noise}, parameters)
