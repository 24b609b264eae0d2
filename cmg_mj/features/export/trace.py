"""Traces a controller's formulas as CasADi functions: measurement, observer, law."""

from __future__ import annotations

from typing import NamedTuple

import casadi

from cmg_mj.core.tilt import GimbalAngle, RadialTilt
from cmg_mj.core.types import Law, Measurement, Observer, extra_signals
from cmg_mj.features.export.constants import Constants
from cmg_mj.features.export.formulas import (
    MEASURED,
    MOST_NUMBERS,
    as_written,
    call_traced,
    function_of,
    needed_numbers,
    symbols_named,
)
from cmg_mj.features.export.names import identifiers
from cmg_mj.features.export.pytree import form, numbers, rebuild
from cmg_mj.features.export.source_location import NotExportable
from cmg_mj.features.export.symbol import expression
from cmg_mj.features.export.traced_law import TracedLaw, trace_law


class Traced(NamedTuple):
    """A controller's formulas.

    Attributes:
        state: Names of the numbers in the observer's state that a result depends on.
        measure: (raw accelerations, encoders, constants) -> y1, y2, acceleration.
        init: (y1, y2, acceleration) -> state.
        step: (state, y1, y2, acceleration, u) -> state, estimate.
        law: The law's formulas.
    """

    state: tuple[str, ...]
    measure: casadi.Function
    init: casadi.Function
    step: casadi.Function
    law: TracedLaw


def trace(observer: Observer, law: Law, constants: Constants) -> Traced:
    """Trace a controller's formulas.

    Args:
        observer: The observer. Do not use it again: it may remember symbols.
        law: The law. Do not use it again either.
        constants: The constants of measurement and law, which keep their names.

    Returns:
        The formulas.

    Raises:
        NotExportable: A formula cannot express what the observer does.
        LawNotExportable: A formula cannot express what the law does.
    """
    with as_written():
        observer_formulas = _trace_observer(observer, _measure(constants))
        return Traced(*observer_formulas, trace_law(law, constants, len(extra_signals(observer))))


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
