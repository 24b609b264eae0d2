"""Observers by name, and a user's own by dotted path."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterable
from typing import Any

from pydantic import ValidationError

from cmg_mj.complaint import complaint
from cmg_mj.errors import InputError, nearest, raised
from cmg_mj.observers.protocol import Observer
from cmg_mj.reduced import ReducedModel
from cmg_mj.tilt import TiltNoise

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

GIVEN = ("dt", "model", "noise")
"""What the bench gives every observer whose constructor takes it; all else is the user's choice."""


def observer_class(kind: str) -> type:
    """Find an observer's class.

    Args:
        kind: A name of `OBSERVERS`, or `package.module:Class`.

    Returns:
        The class.

    Raises:
        InputError: There is no such observer, or its module cannot be imported.
    """
    if ":" not in kind and kind not in OBSERVERS:
        raise InputError(
            f"observer.kind = {kind!r}: no such observer; {nearest(kind, OBSERVERS)}, "
            "or your own as package.module:Class"
        )
    path = OBSERVERS.get(kind, kind)
    module_name, _, class_name = path.partition(":")
    try:
        found = getattr(importlib.import_module(module_name), class_name)
    except (Exception, SystemExit) as error:  # a user's module may fail in any way while it is imported
        raise InputError(f"observer.kind = {kind!r}: cannot be imported: {raised(error)}") from error
    if not (
        inspect.isclass(found) and callable(getattr(found, "init", None)) and callable(getattr(found, "step", None))
    ):
        raise InputError(f"observer.kind = {kind!r}: must be a class with the methods init(y) and step(state, y, u)")
    return found


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
    cls = observer_class(kind)
    check_names(kind, parameters)
    taken = inspect.signature(cls).parameters
    given: dict[str, Any] = {"dt": dt, "model": model}
    if "noise" in taken:
        if noise is None and taken["noise"].default is inspect.Parameter.empty:
            raise InputError(f"observer {kind}: needs the noise of its sensors (a TiltNoise after the model)")
        given["noise"] = noise
    try:
        return cls(**given, **parameters)
    except ValidationError as error:
        clause = complaint(cls, error.errors()[0], {**given, **parameters})
        raise InputError(f"observer.{clause} (observer {kind})") from error
    except (Exception, SystemExit) as error:  # a user's own class may refuse its parameters in its own way
        raise InputError(f"observer {kind}: {raised(error)}") from error


def check_names(kind: str, names: Iterable[str]) -> None:
    """Refuse the names of parameters that an observer does not have.

    Args:
        kind: A name of `OBSERVERS`, or `package.module:Class`.
        names: Of its parameters.

    Raises:
        InputError: Unknown observer or parameter.
    """
    cls = observer_class(kind)
    allowed = [name for name in inspect.signature(cls).parameters if name not in GIVEN]
    for name in names:
        if name not in allowed and not _takes_any(cls):
            what = nearest(name, allowed) if allowed else "it has none"
            raise InputError(f"observer.{name}: {kind} has no such parameter; {what}")


def takes_noise(kind: str) -> bool:
    """Whether an observer is told the noise of its sensors."""
    return "noise" in inspect.signature(observer_class(kind)).parameters


def _takes_any(cls: type) -> bool:
    kinds = [p.kind for p in inspect.signature(cls).parameters.values()]
    return inspect.Parameter.VAR_KEYWORD in kinds
