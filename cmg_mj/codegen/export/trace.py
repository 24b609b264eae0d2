"""A controller's formulas written down as CasADi functions: measurement, observer, law."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import casadi

from cmg_mj.codegen.export.c_identifiers import identifiers
from cmg_mj.codegen.export.constants import Constants
from cmg_mj.codegen.export.pytree import form, numbers, rebuilt
from cmg_mj.codegen.export.source_location import NotExportable, raised_at
from cmg_mj.codegen.export.symbol import Symbol, expression
from cmg_mj.controllers.laws.state_feedback import StateFeedback
from cmg_mj.errors import raised
from cmg_mj.observers.protocol import Measurement, Observer
from cmg_mj.sensors.gimbal_angle import GimbalAngle
from cmg_mj.sensors.tilt import RadialTilt

MEASURED = ("y1", "y2", "acceleration")
"""What an observer is given at a sample."""

MOST_NUMBERS = 1000
"""Of a state: 4 kB on a board in single precision. What takes more is not meant for one, and takes CasADi minutes."""


class Traced(NamedTuple):
    """A controller's formulas.

    Attributes:
        state: Names of the numbers in the observer's state that anything depends on.
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
    """Write a controller's formulas down.

    Args:
        observer: The observer. It is used up: one that remembers what it is given remembers symbols now.
        constants: The numbers of the rest, which keep their names.

    Returns:
        The formulas.

    Raises:
        NotExportable: The observer does what has no place in a formula.
    """
    with _as_written():
        return Traced(*_observed(observer, _measure(constants)), _law(constants))


@contextmanager
def _as_written() -> Iterator[None]:
    """CasADi keeps every operation as it is: what it simplifies may round otherwise."""
    before = casadi.GlobalOptions.getSimplificationOnTheFly()
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(before)


def _observed(
    observer: Observer, measure: casadi.Function
) -> tuple[tuple[str, ...], casadi.Function, casadi.Function, casadi.Function]:
    """The first four parts of `Traced`."""
    first = _symbols(MEASURED)
    state = _called("init(y)", lambda: observer.init(Measurement(*first)))
    leaves = list(numbers(state))
    if len(leaves) > MOST_NUMBERS:
        raise NotExportable(f"its state holds {len(leaves)} numbers; at most {MOST_NUMBERS} can be exported")
    held = _symbols([f"state {i}" for i in range(len(leaves))])
    before, y, (u,) = rebuilt(state, iter(held)), _symbols(MEASURED), _symbols(["u"])
    after, estimate = _called("step(state, y, u)", lambda: observer.step(before, Measurement(*y), u))
    moved = [expression(leaf.value) for leaf in numbers(after)]
    if form(after) != form(state):
        raise NotExportable("its step returns a state that is made otherwise than the one of init")
    shown = [expression(part) for part in estimate]

    needed = _needed(held, moved, shown)
    names = identifiers([leaves[i].path for i in needed])
    init = _function("init", first, [expression(leaves[i].value) for i in needed])
    step = _function("step", [*(held[i] for i in needed), *y, u], [*(moved[i] for i in needed), *shown])
    return tuple(names), measure, init, step


def _needed(held: Sequence[Symbol], moved: Sequence[casadi.SX], shown: Sequence[casadi.SX]) -> list[int]:
    """Which numbers of a state an estimate depends on, now or later. A measurement is kept whole but used in part."""
    place = {symbol.sx.name(): i for i, symbol in enumerate(held)}
    needed: set[int] = set()
    waiting = list(shown)
    while waiting:
        for symbol in casadi.symvar(waiting.pop()):
            i = place.get(symbol.name())
            if i is not None and i not in needed:
                needed.add(i)
                waiting.append(moved[i])
    return sorted(needed)


def _symbols(names: Sequence[str]) -> list[Symbol]:
    return [Symbol(casadi.SX.sym(name)) for name in names]


def _function(name: str, inputs: Sequence[Symbol], outputs: Sequence[casadi.SX]) -> casadi.Function:
    given = [symbol.sx for symbol in inputs]
    made = casadi.Function(name, given, casadi.cse(list(outputs)) if outputs else [], {"allow_free": True})
    if made.has_free():
        raise NotExportable(
            "it remembers something outside of its state, in self or elsewhere, which C would not have: make it a part "
            "of the state that step returns"
        )
    return made


def _called(what: str, call: Callable[[], Any]) -> Any:
    """Call a user's code with symbols."""
    try:
        return call()
    except NotExportable:
        raise
    except (Exception, SystemExit) as error:
        raise NotExportable(f"{what} raised {raised(error)} {raised_at(error.__traceback__)}") from error


def _measure(constants: Constants) -> casadi.Function:
    """The measurement; the controller's own formulas on symbols."""
    forces = _symbols(["inner_x", "inner_z", "outer_x", "outer_z"])
    encoders = _symbols([f"encoder {i}" for i in range(constants.gimbals)])
    named = _symbols([constant.name for constant in constants.of_measure])
    inner, outer, *rest = named
    directions, zeros = tuple(rest[: constants.gimbals]), tuple(rest[constants.gimbals :])
    tilt, gimbal_angle = RadialTilt(inner, outer), GimbalAngle(directions, zeros)  # type: ignore[arg-type]
    y = (tilt(*forces), gimbal_angle(encoders), tilt.acceleration(forces[0], forces[2]))
    return _function("measure", [*forces, *encoders, *named], [expression(part) for part in y])


def _law(constants: Constants) -> casadi.Function:
    """The law; the controller's own formula on symbols."""
    named = _symbols([constant.name for constant in constants.of_law])
    dt, k1, k2, k3, k4, limit = named
    given = _symbols(["x1", "x2", "x3", "x_e"])
    law = StateFeedback(dt, (k1, k2, k3, k4), limit)  # type: ignore[arg-type]
    return _function("law", [*given, *named], [expression(part) for part in law(*given)])
