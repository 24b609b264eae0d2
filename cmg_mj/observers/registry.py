"""Observers by name, and a user's own by dotted path."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from typing import Any

from cmg_mj.errors import InputError
from cmg_mj.inputs.user_classes import UserClassKind
from cmg_mj.observers.protocol import Observer
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.sensors.tilt import TiltNoise

OBSERVERS = {
    "linear": "cmg_mj.observers.linear:LinearDifferentiator",
    "ltv": "cmg_mj.observers.ltv:LinearTimeVarying",
    "homogeneous": "cmg_mj.observers.homogeneous:Homogeneous",
    "luenberger": "cmg_mj.observers.luenberger:Luenberger",
    "kalman": "cmg_mj.observers.kalman:Kalman",
    "gyro_free": "cmg_mj.observers.gyro_free:GyroFree",
    "finite_difference": "cmg_mj.observers.finite_difference:FiniteDifference",
    "super_twisting": "cmg_mj.observers.super_twisting:SuperTwisting",
    "linear_high_gain": "cmg_mj.observers.linear_high_gain:LinearHighGain",
    "high_gain": "cmg_mj.observers.high_gain:HighGain",
    "adaptive": "cmg_mj.observers.adaptive:Adaptive",
    "homogeneous_adaptive": "cmg_mj.observers.homogeneous_adaptive:HomogeneousAdaptive",
}
"""Name a user types -> dotted path of the class."""

BENCH_PARAMETERS = ("dt", "model", "noise")
"""Arguments that the bench gives to every constructor that takes them; the user chooses all others."""

OF_OBSERVERS = UserClassKind("observer", "observer", OBSERVERS, BENCH_PARAMETERS, {"init": "y", "step": "state, y, u"})
"""The rules by which an observer is found, checked and made."""


def observer_class(kind: str) -> type:
    """Find an observer's class.

    Args:
        kind: A name of `OBSERVERS`, or `package.module:Class`.

    Returns:
        The class.

    Raises:
        InputError: There is no such observer, or its module cannot be imported.
    """
    return OF_OBSERVERS.find(kind)


def make_observer(
    kind: str, dt: float, model: ReducedModel, noise: TiltNoise | None = None, /, **parameters: Any
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
    check_names(kind, parameters)
    signature = OF_OBSERVERS.takes(kind)
    bench_arguments: dict[str, float | ReducedModel | TiltNoise | None] = {"dt": dt, "model": model}
    if "noise" in signature:
        if noise is None and signature["noise"].default is inspect.Parameter.empty:
            raise InputError(f"observer {kind}: needs the noise of its sensors (a TiltNoise after the model)")
        bench_arguments["noise"] = noise
    return OF_OBSERVERS.make(kind, bench_arguments, parameters)


def check_names(kind: str, names: Iterable[str]) -> None:
    """Refuse the names of parameters that an observer does not have.

    Args:
        kind: A name of `OBSERVERS`, or `package.module:Class`.
        names: Of its parameters.

    Raises:
        InputError: Unknown observer or parameter.
    """
    OF_OBSERVERS.check_names(kind, names)


def takes_noise(kind: str) -> bool:
    """Return whether an observer is constructed with the noise of its sensors."""
    return "noise" in OF_OBSERVERS.takes(kind)
