"""Errors of observers and laws that name who failed, and when, with the user's own frames."""

from __future__ import annotations

import math
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from cmg_mj.core.arrays import Scalar, Symbolic
from cmg_mj.core.errors import RunStopped
from cmg_mj.core.types import Law, Measurement, Observer

_PACKAGE = str(Path(__file__).parents[1])


def is_trusted(part: Observer | Law) -> bool:
    """Return whether a part is the package's own, whose numbers have the same shapes at every tick."""
    return type(getattr(part, "stands_for", part)).__module__.startswith("cmg_mj.")


def check_estimate(estimate: Sequence[Scalar], names: Sequence[str], y: Measurement) -> None:
    """Refuse an estimate whose parts are not a real number of each world.

    Raises:
        TypeError: It has other parts than these names, or one of another shape than the measurement.
    """
    if len(estimate) != len(names):
        raise TypeError(f"step(state, y, u) returned {len(estimate)} numbers, not {', '.join(names)}")
    for name, value in zip(names, estimate, strict=True):
        check_shape(name, value, y)


def check_shape(name: str, value: Scalar, y: Measurement) -> None:
    """Refuse what is not a real number of each world; symbols are.

    Raises:
        TypeError: It has another shape than the measurement.
    """
    if isinstance(y.y1, Symbolic):
        return
    number = np.asarray(value)
    if np.ma.is_masked(value):
        raise TypeError(f"{name} is masked")
    if number.shape != np.shape(y.y1) or number.dtype.kind not in "fiu":
        raise TypeError(f"{name} has shape {number.shape} of {number.dtype}, not {np.shape(y.y1)} of float64")


def stop_not_finite(observer: Observer, estimate: Sequence[Scalar], names: Sequence[str], time: float) -> None:
    """Stop the run of one world whose observer returned a number that is not finite, at a time [s].

    Raises:
        RunStopped: It did.
    """
    for name, value in zip(names, estimate, strict=True):
        if not math.isfinite(value):
            returned = f"{type(observer).__name__} returned {value} for {name}"
            raise RunStopped(f"observer {returned} at t = {time:g} s")


def stop(part: Any, kind: str, time: float, error: Exception) -> NoReturn:
    """Stop the run in which an observer or a law failed, at a time [s]; show the error with the user's own frames.

    Raises:
        RunStopped: Always.
    """
    frames = error.__traceback__
    while frames is not None and frames.tb_frame.f_code.co_filename.startswith(_PACKAGE):
        frames = frames.tb_next
    part = getattr(part, "stands_for", part)
    shown = "".join(traceback.format_exception(type(error), error, frames, chain=False)).rstrip()
    raise RunStopped(f"{kind} {type(part).__name__} failed at t = {time:g} s\n{shown}") from error
