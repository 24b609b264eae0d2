"""Traces a controller's formulas as CasADi functions: measurement, observer, law."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, TypeVar

import casadi

from cmg_mj.codegen.export.c_identifiers import identifiers
from cmg_mj.codegen.export.constants import Constants
from cmg_mj.codegen.export.pytree import form, numbers, rebuild
from cmg_mj.codegen.export.source_location import NotExportable, raised_at
from cmg_mj.codegen.export.symbol import Symbol, expression
from cmg_mj.controllers.laws.state_feedback import StateFeedback
from cmg_mj.errors import raised
from cmg_mj.observers.protocol import Measurement, Observer
from cmg_mj.sensors.gimbal_angle import GimbalAngle
from cmg_mj.sensors.tilt import RadialTilt

Result = TypeVar("Result")

MEASURED = ("y1", "y2", "acceleration")
"""Names of an observer's measurements."""

MOST_NUMBERS = 1000
"""Largest state: 4 kB on a board in single precision. More is not meant for a board, and takes CasADi minutes."""


class Traced(NamedTuple):
    """A controller's formulas.

    Attributes:
        state: Names of the numbers in the observer's state that a result depends on.
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


def trace(observer: Observer, constants: Constants) -> Traced:
    """Trace a controller's formulas.

    Args:
        observer: The observer. Do not use it again: it may remember symbols.
        constants: The constants of measurement and law, which keep their names.

    Returns:
        The formulas.

    Raises:
        NotExportable: A formula cannot express what the observer does.
    """
    with as_written():
        return Traced(*_trace_observer(observer, _measure(constants)), _law(constants))


@contextmanager
def as_written() -> Iterator[None]:
    """Turn CasADi's simplifications off: a simplified formula may round otherwise."""
    before = casadi.GlobalOptions.getSimplificationOnTheFly()
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(before)


def _trace_observer(
    observer: Observer, measure: casadi.Function
) -> tuple[tuple[str, ...], casadi.Function, casadi.Function, casadi.Function]:
    """Return the first four parts of `Traced`."""
    first = symbols_named(MEASURED)
    state = call_traced("init(y)", lambda: observer.init(Measurement(*first)))
    leaves = list(numbers(state))
    if len(leaves) > MOST_NUMBERS:
        raise NotExportable(f"its state holds {len(leaves)} numbers; at most {MOST_NUMBERS} can be exported")
    symbols = symbols_named([f"state {i}" for i in range(len(leaves))])
    before, y, (u,) = rebuild(state, iter(symbols)), symbols_named(MEASURED), symbols_named(["u"])
    after, estimate = call_traced("step(state, y, u)", lambda: observer.step(before, Measurement(*y), u))
    next_state = [expression(leaf.value) for leaf in numbers(after)]
    if form(after) != form(state):
        raise NotExportable("its step returns a state that is made otherwise than the one of init")
    outputs = [expression(part) for part in estimate]

    needed = needed_numbers(symbols, next_state, outputs)
    names = identifiers([leaves[i].path for i in needed])
    init = function_of("init", first, [expression(leaves[i].value) for i in needed])
    step = function_of("step", [*(symbols[i] for i in needed), *y, u], [*(next_state[i] for i in needed), *outputs])
    return tuple(names), measure, init, step


def needed_numbers(
    symbols: Sequence[Symbol], next_state: Sequence[casadi.SX], outputs: Sequence[casadi.SX]
) -> list[int]:
    """Find the numbers of a state that an estimate depends on, now or later; a state may hold unused measurements."""
    place = {symbol.sx.name(): i for i, symbol in enumerate(symbols)}
    needed: set[int] = set()
    waiting = list(outputs)
    while waiting:
        for symbol in casadi.symvar(waiting.pop()):
            i = place.get(symbol.name())
            if i is not None and i not in needed:
                needed.add(i)
                waiting.append(next_state[i])
    return sorted(needed)


def symbols_named(names: Sequence[str]) -> list[Symbol]:
    """Make a symbol for each name."""
    return [Symbol(casadi.SX.sym(name)) for name in names]


def function_of(name: str, inputs: Sequence[Symbol], outputs: Sequence[casadi.SX]) -> casadi.Function:
    """Make a function of symbols.

    Raises:
        NotExportable: The outputs depend on other symbols.
    """
    arguments = [symbol.sx for symbol in inputs]
    function = casadi.Function(name, arguments, casadi.cse(list(outputs)) if outputs else [], {"allow_free": True})
    if function.has_free():
        raise NotExportable(
            "it remembers something outside of its state, in self or elsewhere, which C would not have: make it a part "
            "of the state that step returns"
        )
    return function


def call_traced(name: str, function: Callable[[], Result]) -> Result:
    """Call a user's code with symbols."""
    try:
        return function()
    except NotExportable:
        raise
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise NotExportable(f"{name} raised {raised(error)} {raised_at(error.__traceback__)}") from error


def _measure(constants: Constants) -> casadi.Function:
    """Trace the measurement by the controller's formulas."""
    forces = symbols_named(["inner_x", "inner_z", "outer_x", "outer_z"])
    encoders = symbols_named([f"encoder {i}" for i in range(constants.gimbals)])
    parameters = symbols_named([constant.name for constant in constants.of_measure])
    inner, outer, *rest = parameters
    directions, zeros = tuple(rest[: constants.gimbals]), tuple(rest[constants.gimbals :])
    tilt, gimbal_angle = RadialTilt(inner, outer), GimbalAngle(directions, zeros)  # type: ignore[arg-type]
    y = (tilt(*forces), gimbal_angle(encoders), tilt.acceleration(forces[0], forces[2]))
    return function_of("measure", [*forces, *encoders, *parameters], [expression(part) for part in y])


def _law(constants: Constants) -> casadi.Function:
    """Trace the law by the controller's formula."""
    parameters = symbols_named([constant.name for constant in constants.of_law])
    dt, k1, k2, k3, k4, limit = parameters
    inputs = symbols_named(["x1", "x2", "x3", "x_e"])
    law = StateFeedback(dt, (k1, k2, k3, k4), limit)  # type: ignore[arg-type]
    return function_of("law", [*inputs, *parameters], [expression(part) for part in law(*inputs)])
