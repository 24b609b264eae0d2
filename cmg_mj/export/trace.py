"""A controller's formulas written down as CasADi functions: measurement, observer, law."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import casadi

from cmg_mj.controller import Controller, GimbalAngle
from cmg_mj.errors import InputError, raised
from cmg_mj.export.place import Refused, raised_at
from cmg_mj.export.symbol import Symbol, expression
from cmg_mj.export.tree import form, identifiers, leaves, rebuilt
from cmg_mj.law import Law
from cmg_mj.observers.protocol import Measurement, Observer
from cmg_mj.tilt import RadialTilt


MEASURED = ("y1", "y2", "acceleration")
"""What an observer is given at a sample."""


@dataclass(frozen=True)
class Traced:
    """A controller's formulas.

    Attributes:
        state: What the numbers of the observer's state are called.
        measure: (raw accelerations, encoders, constants) -> y1, y2, acceleration.
        init: (y1, y2, acceleration) -> state.
        step: (state, y1, y2, acceleration, u) -> state, estimate.
        law: (x1, x2, x3, x_e, constants) -> u, the next x_e.
    """

    state: tuple[str, ...]
    measure: casadi.Function
    init: casadi.Function
    step: casadi.Function
    law: casadi.Function


def trace(controller: Controller, constants: Any) -> Traced:
    """Write a controller's formulas down.

    Args:
        controller: The controller. Its observer is used up: it may keep what it is given.
        constants: What the constants of the controller are called in C, see `constants.Constants`.

    Returns:
        The formulas.

    Raises:
        InputError: The observer does what has no place in a formula.
    """
    with _as_written():
        state, init, step = _observer(controller.observer)
        return Traced(state, _measure(constants), init, step, _law(constants))


@contextmanager
def _as_written() -> Iterator[None]:
    """CasADi keeps every operation as it is: what it simplifies may round otherwise."""
    before = casadi.GlobalOptions.getSimplificationOnTheFly()
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(before)


def _symbols(names: Sequence[str]) -> list[Symbol]:
    return [Symbol(casadi.SX.sym(name)) for name in names]


def _function(name: str, inputs: Sequence[Symbol], outputs: Sequence[Any]) -> casadi.Function:
    given = [symbol.sx for symbol in inputs]
    made = casadi.Function(name, given, [expression(x) for x in outputs], {"allow_free": True})
    if made.has_free():
        raise Refused(
            "the observer remembers something outside of its state (in self, or elsewhere), which C would not have: "
            "return it from step as a part of the state"
        )
    return made


def _observer(observer: Observer) -> tuple[tuple[str, ...], casadi.Function, casadi.Function]:
    """Names of the state's numbers, init and step."""
    measured = _symbols(MEASURED)
    state = _called("init(y)", lambda: observer.init(Measurement(*measured)))
    numbers = [leaf for leaf in leaves(state) if leaf.number]
    names = identifiers([leaf.path for leaf in numbers])
    init = _function("init", measured, [leaf.value for leaf in numbers])

    held, (u,) = _symbols(names), _symbols(["u"])
    before, measured = rebuilt(state, iter(held)), _symbols(MEASURED)
    after, estimate = _called("step(state, y, u)", lambda: observer.step(before, Measurement(*measured), u))
    if form(after) != form(state):
        raise Refused("step returns a state that is made otherwise than that of init")
    moved = [leaf.value for leaf in leaves(after) if leaf.number]
    return tuple(names), init, _function("step", [*held, *measured, u], [*moved, *estimate])


def _called(what: str, call: Callable[[], Any]) -> Any:
    """Call a user's code with symbols."""
    try:
        return call()
    except Refused:
        raise
    except (Exception, SystemExit) as error:
        raise InputError(f"{what} raised {raised(error)} {raised_at(error.__traceback__)}") from error


def _measure(constants: Any) -> casadi.Function:
    accelerations, encoders = _symbols(["ix", "iz", "ox", "oz"]), _symbols([f"e{i}" for i in range(constants.encoders)])
    named = _symbols(constants.measure)
    inner, outer, *rest = named
    directions, zeros = rest[: constants.encoders], rest[constants.encoders :]
    tilt, gimbal_angle = RadialTilt(inner, outer), GimbalAngle(tuple(directions), tuple(zeros))  # type: ignore[arg-type]
    y = [tilt(*accelerations), gimbal_angle(encoders), tilt.acceleration(accelerations[0], accelerations[2])]
    return _function("measure", [*accelerations, *encoders, *named], y)


def _law(constants: Any) -> casadi.Function:
    named = _symbols(constants.law)
    dt, k1, k2, k3, k4, limit = named
    law = Law(dt, (k1, k2, k3, k4), limit)  # type: ignore[arg-type]
    given = _symbols(["x1", "x2", "x3", "x_e"])
    return _function("law", [*given, *named], law(*given))
