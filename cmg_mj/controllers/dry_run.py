"""An observer and a law tried once before a run, so that one that cannot work is found before its first sample."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cmg_mj.core.runners import read_only
from cmg_mj.core.types import Law, extra_signals, feedback_state
from cmg_mj.elementwise import Scalar
from cmg_mj.errors import InputError, listed, raised, shown
from cmg_mj.inputs.users_line import in_users_line
from cmg_mj.observers import Measurement, Observer

TILTS = (0.01, 0.011)
"""The tilts of the two samples [rad]."""


def dry_run_observer(observer: Observer, worlds: int | None) -> None:
    """Two samples of one observer, on floats or on arrays of so many worlds."""
    first, second, u = _samples(worlds)
    call = "init(y)"
    try:
        names = ("x1", "x2", "x3", *extra_signals(observer))
    except ValueError as error:
        raise InputError(str(error)) from error
    try:
        state = observer.init(first)
        call = "step(state, y, u)"
        returned = observer.step(state, second, u)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a user's observer may fail in any way
        raise InputError(
            f"{call} raised {raised(error)}{in_users_line(error)}{_longer_estimate(error)}{_hint(worlds)}"
        ) from error
    try:
        _, estimate = returned
        if not hasattr(estimate, "__len__"):  # a generator, which could be read once
            raise TypeError
        parts = list(zip(names, estimate, strict=True))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{call} must return (state, ({listed(names)})), not {_given(returned, len(names))}"
        ) from error
    for name, value in parts:
        _check_number(call, name, value, worlds)


def dry_run_law(law: Law, extra: int, worlds: int | None) -> None:
    """Two samples of a law, fed back with so many signals beyond x, on floats or on arrays of so many worlds."""
    first, second, u = _samples(worlds)
    call = "init(y)"
    try:
        state = law.init(first)
        call = "step(state, y, x, u)"
        for tilt, y, rate, held in ((TILTS[0], first, 0.0 * u, 0.0 * u), (TILTS[1], second, u, u)):
            if worlds is not None:
                read_only(held)
            returned = law.step(state, y, feedback_state(y[0], rate, y[1], (rate,) * extra), held)
            _check_command(call, returned, state, worlds, tilt)
            state = returned[0]
    except InputError:
        raise
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a user's law may fail in any way
        raise InputError(f"{call} raised {raised(error)}{in_users_line(error)}{_hint(worlds)}") from error
    trimmed = getattr(law, "trim_gain", None) is not None
    if trimmed and not (hasattr(state, "_replace") and hasattr(state, "x_e")):
        raise InputError(f"has a trim_gain, so its state must be a NamedTuple with x_e, not {shown(state)}")


def _check_command(call: str, returned: Any, state: Any, worlds: int | None, tilt: float) -> None:
    """Check that a law returned a state and a gimbal rate."""
    if not isinstance(returned, tuple) or len(returned) != 2:
        raise InputError(f"{call} must return (state, u), not {shown(returned)}")
    _check_number(call, "u", returned[1], worlds, tilt)
    x_e = getattr(state, "x_e", math.nan)
    number = np.asarray(x_e)
    if number.dtype.kind not in "fiu" or number.shape not in ((), (worlds or 1,)):
        raise InputError(f"x_e in its state must be {_wanted(worlds)}, not {shown(x_e)}")


def _samples(worlds: int | None) -> tuple[Measurement, Measurement, Scalar]:
    """Two measurements, and the gimbal rate between them, as a run has them."""

    def sample(tilt: float) -> Measurement:
        y = Measurement(tilt, -tilt, tilt)
        return y if worlds is None else Measurement(*(np.full(worlds, number) for number in (*y, y.acceleration)))

    u: Any = 0.1 if worlds is None else np.full(worlds, 0.1)
    first, second = map(sample, TILTS)
    if worlds is not None:
        read_only(*first, first.acceleration, *second, second.acceleration, u)
    return first, second, u


def _longer_estimate(error: BaseException) -> str:
    """Say how an estimate of more than x is written, to who gave `Estimate` more than its three parts."""
    if not isinstance(error, TypeError) or "Estimate.__new__()" not in str(error):
        return ""
    return "; extra signals follow an estimate of three parts, as in (*Estimate(x1, x2, x3), bias_rad)"


def _hint(worlds: int | None) -> str:
    if worlds is None:
        return ""
    return "; many worlds come at once, as arrays that must not be changed: use operators and cmg_mj.elementwise"


def _wanted(worlds: int | None) -> str:
    return "a number" if worlds is None else f"an array of {worlds} numbers"


def _given(returned: Any, wanted: int) -> str:
    if not (isinstance(returned, tuple) and len(returned) == 2):
        return shown(returned)
    longer = isinstance(returned[1], (tuple, list)) and len(returned[1]) > wanted
    named = "; extra_signals names what comes after x3" if longer else ""
    return f"(state, {shown(returned[1])}){named}"


def _check_number(call: str, name: str, value: Any, worlds: int | None, tilt: float = TILTS[1]) -> None:
    """Check that a part of a step's result is a number of each world."""
    number = np.asarray(value)
    if number.dtype.kind not in "fiu" or number.shape != (() if worlds is None else (worlds,)):
        raise InputError(f"{call} must return {_wanted(worlds)} for {name}, not {shown(value)}{_hint(worlds)}")
    if not np.all(np.isfinite(number)):
        raise InputError(f"{call} returned {shown(value)} for {name} at a tilt of {tilt:g} rad")
