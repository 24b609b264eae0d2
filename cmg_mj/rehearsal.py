"""An observer tried once before a run, so that one that cannot work is found before its first sample."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmg_mj.errors import InputError, raised, shown
from cmg_mj.observers import Measurement, Observer
from cmg_mj.observers.protocol import extra_signals
from cmg_mj.observing import read_only


def rehearse(observer: Observer, worlds: int | None) -> None:
    """Two samples of one observer, on floats or on arrays of so many worlds."""

    def sample(tilt: float) -> Measurement:
        y = Measurement(tilt, -tilt, tilt)
        return y if worlds is None else Measurement(*(np.full(worlds, number) for number in (*y, y.acceleration)))

    hint = (
        ""
        if worlds is None
        else "; many worlds come at once, as arrays that must not be changed: use operators and cmg_mj.elementwise"
    )
    u: Any = 0.1 if worlds is None else np.full(worlds, 0.1)
    first, second = sample(0.01), sample(0.011)
    if worlds is not None:
        read_only(*first, first.acceleration, *second, second.acceleration, u)
    call = "init(y)"
    try:
        names = ("x1", "x2", "x3", *extra_signals(observer))
    except ValueError as error:
        raise InputError(str(error)) from error
    try:
        state = observer.init(first)
        call = "step(state, y, u)"
        returned = observer.step(state, second, u)
    except (Exception, SystemExit) as error:  # a user's observer may fail in any way
        raise InputError(f"{call} raised {raised(error)}{hint}") from error
    try:
        _, estimate = returned
        if not hasattr(estimate, "__len__"):  # a generator, which could be read once
            raise TypeError
        parts = list(zip(names, estimate, strict=True))
    except (TypeError, ValueError) as error:
        pair = isinstance(returned, tuple) and len(returned) == 2
        given = f"(state, {shown(returned[1])})" if pair else shown(returned)
        raise InputError(f"{call} must return (state, ({', '.join(names)})), not {given}") from error
    for name, value in parts:
        number = np.asarray(value)
        if number.dtype.kind not in "fiu" or number.shape != np.shape(u):
            wanted = "a number" if worlds is None else f"an array of {worlds} numbers"
            raise InputError(f"{call} must return {wanted} for {name}, not {shown(value)}{hint}")
        if not np.all(np.isfinite(number)):
            raise InputError(f"{call} returned {shown(value)} for {name} at a tilt of 0.011 rad")
