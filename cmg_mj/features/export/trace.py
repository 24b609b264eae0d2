"""Traces a controller's formulas as CasADi functions: measurement, observer, law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi

from cmg_mj.core.errors import InputError
from cmg_mj.core.tilt import GimbalAngle, PairTilt
from cmg_mj.core.tree import Leaf, form, numbers, rebuild
from cmg_mj.core.types import Law, Measurement, Observer, extra_signals, feedback_state, reads_gyro
from cmg_mj.features.export.constants import Constants
from cmg_mj.features.export.names import identifiers
from cmg_mj.features.export.symbol import (
    GYRO,
    MAX_NUMBERS,
    MEASURED,
    LawNotExportable,
    Symbol,
    as_written,
    call_traced,
    expression,
    function_of,
    needed_numbers,
    symbols_named,
)
from cmg_mj.laws.state_feedback import StateFeedback


class Traced(NamedTuple):
    """A controller's formulas.

    Attributes:
        state: Names of the numbers in the observer's state that a result depends on.
        measured: Names of what the observer takes: `MEASURED`, and the gyro if it needs one.
        measure: (raw accelerations, encoders, constants) -> y1, y2, acceleration.
        init: (measured) -> state.
        step: (state, measured, u) -> state, estimate.
        law: The law's formulas.
    """

    state: tuple[str, ...]
    measured: tuple[str, ...]
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
        InputError: A formula cannot express what the observer does.
        LawNotExportable: A formula cannot express what the law does.
    """
    with as_written():
        measured = (*MEASURED, GYRO) if reads_gyro(observer) else MEASURED
        y, (u,) = symbols_named(measured), symbols_named(["u"])
        first, _, leaves, symbols, after, outputs = _record(
            observer, "step(state, y, u)", lambda before: observer.step(before, Measurement(*y), u), measured
        )
        needed = needed_numbers(symbols, after, outputs)
        names = identifiers([leaves[i].path for i in needed])
        init = function_of("init", first, [expression(leaves[i].value) for i in needed])
        step = function_of("step", [*(symbols[i] for i in needed), *y, u], [*(after[i] for i in needed), *outputs])
        if type(law) is StateFeedback:
            law_formulas = _trace_state_feedback(constants)
        else:
            try:
                law_formulas = _trace_law(law, len(extra_signals(observer)))
            except InputError as error:
                raise LawNotExportable(str(error)) from error
        return Traced(tuple(names), measured, _measure(constants), init, step, law_formulas)


def _record(
    part: Observer | Law,
    label: str,
    step: Callable[[Any], tuple[Any, Sequence[Any]]],
    measured: Sequence[str] = MEASURED,
) -> tuple[list[Symbol], Any, list[Leaf], list[Symbol], list[casadi.SX], list[casadi.SX]]:
    """Run a part's init and, with symbols in the place of its state's numbers, a step.

    Returns:
        The measurement that init took; its state, and the numbers in it; a symbol for each of them, which the step
        took; the numbers in the state that the step returned; what it returned beside the state.
    """
    first = symbols_named(measured)
    state = call_traced("init(y)", lambda: part.init(Measurement(*first)))
    leaves = list(numbers(state))
    if len(leaves) > MAX_NUMBERS:
        raise InputError(f"its state holds {len(leaves)} numbers; at most {MAX_NUMBERS} can be exported")
    symbols = symbols_named([f"state {i}" for i in range(len(leaves))])
    before = rebuild(state, iter(symbols))
    after, outputs = call_traced(label, lambda: step(before))
    next_state = [expression(leaf.value) for leaf in numbers(after)]
    if form(after) != form(state):
        raise InputError("its step returns a state that is made otherwise than the one of init")
    return first, state, leaves, symbols, next_state, [expression(output) for output in outputs]


def _measure(constants: Constants) -> casadi.Function:
    """Trace the measurement by the controller's formulas."""
    forces = symbols_named(["inner_x", "inner_z", "outer_x", "outer_z"])
    encoders = symbols_named([f"encoder {i}" for i in range(constants.gimbals)])
    parameters = symbols_named([constant.name for constant in constants.of_measure])
    n = constants.gimbals
    inner, outer, directions, zeros = (
        *parameters[:2],
        tuple(parameters[2 : 2 + n]),
        tuple(parameters[2 + n : 2 + 2 * n]),
    )
    beside = tuple(parameters[2 + 2 * n :])  # across and angles, if there are any
    lies = {"across": beside[:2], "angles": beside[2:]} if beside else {}
    tilt, gimbal_angle = PairTilt(inner, outer, **lies), GimbalAngle(directions, zeros)  # type: ignore[arg-type]
    y = (tilt(*forces), gimbal_angle(encoders), tilt.acceleration(*forces))
    return function_of("measure", [*forces, *encoders, *parameters], [expression(part) for part in y])


INTEGRATOR = ("x_e",)
"""Path of the integrator in a law's state."""


def law_arguments(extra_signals: int) -> list[str]:
    """Name in C whatever a law may take at a decision: measurement, feedback, extra signals, the command held."""
    return [*MEASURED, "x1", "x2", "x3", *(f"estimate[{3 + i}]" for i in range(extra_signals)), "held"]


class TracedLaw(NamedTuple):
    """A law's formulas.

    Attributes:
        arguments: Those of `law_arguments` that a decision depends on.
        measured: Those of `MEASURED` that the first state depends on.
        state: Names in C of the numbers in its state that a decision depends on, without the integrator.
        has_integrator: Whether its state has an integrator.
        init: (y1, y2, acceleration) -> state, integrator; None for (8), whose integrator begins at zero.
        step: (arguments, state, integrator, constants) -> u, the next state, the next integrator.
    """

    arguments: tuple[str, ...]
    measured: tuple[str, ...]
    state: tuple[str, ...]
    has_integrator: bool
    init: casadi.Function | None
    step: casadi.Function

    @property
    def is_state_feedback(self) -> bool:
        """True for (8), which keeps u within its limit by itself, and whose numbers have names in C."""
        return self.init is None

    @property
    def numbers(self) -> int:
        """Numbers in its state, the integrator included, which is the last."""
        return len(self.state) + self.has_integrator


def _trace_state_feedback(constants: Constants) -> TracedLaw:
    """Trace (8) with symbols for its numbers."""
    parameters = symbols_named([constant.name for constant in constants.of_law])
    dt, k1, k2, k3, k4, limit = parameters
    inputs = symbols_named(["x1", "x2", "x3", "x_e"])
    law = StateFeedback(dt, (k1, k2, k3, k4), limit)  # type: ignore[arg-type]
    step = function_of("law", [*inputs, *parameters], [expression(part) for part in law(*inputs)])
    return TracedLaw(("x1", "x2", "x3"), (), (), True, None, step)


def _trace_law(law: Law, extra_signals: int) -> TracedLaw:
    names = law_arguments(extra_signals)
    arguments = symbols_named(names)
    y, (x1, x2, x3, *extra), held = Measurement(*arguments[:3]), arguments[3:-1], arguments[-1]

    def step(before: Any) -> tuple[Any, Sequence[Any]]:
        after, u = law.step(before, y, feedback_state(x1, x2, x3, tuple(extra)), held)
        return after, (u,)

    first, state, leaves, symbols, next_state, (command,) = _record(law, "step(state, y, x, u)", step)
    integrator = [i for i, leaf in enumerate(leaves) if leaf.path == INTEGRATOR and hasattr(state, "x_e")]
    if hasattr(state, "x_e") and not integrator:
        raise InputError("its integrator x_e is no number in its state, where C would have it")
    needed = needed_numbers(symbols, next_state, [command, *(symbols[i].sx for i in integrator)])
    kept = [i for i in needed if i not in integrator] + integrator
    begin, outputs = [expression(leaves[i].value) for i in kept], [command, *(next_state[i] for i in kept)]
    used = _used(names, arguments, outputs)
    return TracedLaw(
        tuple(used),
        tuple(_used(MEASURED, first, begin)),
        tuple(identifiers([leaves[i].path for i in kept if i not in integrator])),
        bool(integrator),
        function_of("init_law", first, begin),
        function_of("law", [*used.values(), *(symbols[i] for i in kept)], outputs),
    )


def _used(names: Sequence[str], symbols: Sequence[Symbol], outputs: Sequence[casadi.SX]) -> dict[str, Symbol]:
    """Select the symbols that a formula depends on: name -> symbol."""
    in_use = {symbol.name() for output in outputs for symbol in casadi.symvar(output)}
    return {name: symbol for name, symbol in zip(names, symbols, strict=True) if name in in_use}
