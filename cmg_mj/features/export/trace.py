"""Traces a controller's formulas by running its code on symbols: measurement, observer, law."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

from cmg_mj.core.errors import InputError, raised
from cmg_mj.core.tape import Operand, Symbol, Tape, located
from cmg_mj.core.tilt import GimbalAngle, PairTilt
from cmg_mj.core.tree import Leaf, form, numbers, rebuild
from cmg_mj.core.types import Law, Measurement, Observer, extra_signals, feedback_state, reads_gyro
from cmg_mj.features.export.constants import Constants
from cmg_mj.features.export.formula import Formula, formula, symbols
from cmg_mj.features.export.names import identifiers
from cmg_mj.laws.state_feedback import StateFeedback

MEASURED = ("y1", "y2", "acceleration")
GYRO = "gyro"
"""Names of an observer's measurements."""

MAX_NUMBERS = 1000
"""Largest state: 4 kB on a board in single precision. More is not meant for a board."""

COMPILED = (
    ": compiled routines of numpy and scipy take no symbols; write it out in + - * /, as the inverse of "
    "[[a, b], [c, d]]: [[d, -b], [-c, a]] / (a*d - b*c)"
)

Result = TypeVar("Result")


class LawNotExportable(InputError):
    """A control law that cannot be exported; all else is the observer's."""


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
    measure: Formula
    init: Formula
    step: Formula
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
    tape = Tape()
    measured = (*MEASURED, GYRO) if reads_gyro(observer) else MEASURED
    y = symbols(tape, len(measured))
    (u,) = symbols(tape, 1)
    part = _record(
        tape, observer, "step(state, y, u)", lambda before: observer.step(before, Measurement(*y), u), measured
    )
    kept = part.needed(part.outputs)
    names = identifiers([part.leaves[i].path for i in kept])
    init = part.init(kept)
    step = formula(tape, [*(part.before[i] for i in kept), *y, u], [*(part.after[i] for i in kept), *part.outputs])
    if type(law) is StateFeedback:
        law_formulas = _trace_state_feedback(tape, constants)
    else:
        try:
            law_formulas = _trace_law(tape, law, len(extra_signals(observer)))
        except InputError as error:
            raise LawNotExportable(str(error)) from error
    return Traced(tuple(names), measured, _measure(tape, constants), init, step, law_formulas)


class _Recording(NamedTuple):
    """A part's init, and its step from a state of symbols.

    Attributes:
        tape: The tape that recorded them.
        first: The measurement that init took.
        state: The state that it returned.
        leaves: The numbers in it.
        before: A symbol for each of them, which the step took.
        after: The numbers in the state that the step returned.
        outputs: The results beside the state.
    """

    tape: Tape
    first: list[Symbol]
    state: Any
    leaves: list[Leaf]
    before: list[Symbol]
    after: list[Operand]
    outputs: Sequence[Operand]

    def needed(self, results: Sequence[Operand]) -> list[int]:
        """Find the numbers of the state that results depend on, now or later; it may hold unused measurements."""
        needed: list[int] = []
        while True:
            places = map(self.tape.place, [*results, *(self.after[i] for i in needed)])
            used = self.tape.needed(places)
            found = [i for i, symbol in enumerate(self.before) if symbol.place in used]
            if found == needed:
                return needed
            needed = found

    def init(self, kept: Sequence[int]) -> Formula:
        """Return the formula of these numbers at the first sample."""
        return formula(self.tape, self.first, [self.leaves[i].value for i in kept])


def _record(
    tape: Tape,
    part: Observer | Law,
    label: str,
    step: Callable[[Any], tuple[Any, Sequence[Any]]],
    measured: Sequence[str] = MEASURED,
) -> _Recording:
    """Run a part's init and, with symbols in the place of its state's numbers, a step."""
    first = symbols(tape, len(measured))
    state = _call("init(y)", lambda: part.init(Measurement(*first)))
    leaves = list(numbers(state))
    if len(leaves) > MAX_NUMBERS:
        raise InputError(f"its state holds {len(leaves)} numbers; at most {MAX_NUMBERS} can be exported")
    before = symbols(tape, len(leaves))
    rebuilt = rebuild(state, iter(before))
    after, outputs = _call(label, lambda: step(rebuilt))
    next_numbers = [leaf.value for leaf in numbers(after)]
    if form(after) != form(state):
        raise InputError("its step returns a state that is made otherwise than the one of init")
    return _Recording(tape, first, state, leaves, before, next_numbers, outputs)


def _call(name: str, function: Callable[[], Result]) -> Result:
    """Call a user's code with symbols."""
    try:
        return function()
    except (InputError, KeyboardInterrupt):
        raise
    except BaseException as error:
        walked = reversed(list(traceback.walk_tb(error.__traceback__)))
        text = raised(error)
        cure = COMPILED if "from dtype('O')" in text or "object arrays" in text else ""
        raise InputError(f"{name} raised {text} {located(walked)}{cure}") from error


def _measure(tape: Tape, constants: Constants) -> Formula:
    """Trace the measurement by the controller's formulas."""
    n = constants.gimbals
    forces = symbols(tape, 4)
    encoders = symbols(tape, n)
    parameters = symbols(tape, len(constants.of_measure))
    inner, outer = parameters[:2]
    directions = tuple(parameters[2 : 2 + n])
    zeros = tuple(parameters[2 + n : 2 + 2 * n])
    beside = tuple(parameters[2 + 2 * n :])  # across and angles, if there are any
    lies = {"across": beside[:2], "angles": beside[2:]} if beside else {}
    tilt = PairTilt(inner, outer, **lies)  # type: ignore[arg-type]
    gimbal_angle = GimbalAngle(directions, zeros)  # type: ignore[arg-type]
    y = [tilt(*forces), gimbal_angle(encoders), tilt.acceleration(*forces)]
    return formula(tape, [*forces, *encoders, *parameters], y)


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
    init: Formula | None
    step: Formula

    @property
    def is_state_feedback(self) -> bool:
        """True for (8), which keeps u within its limit by itself, and whose numbers have names in C."""
        return self.init is None

    @property
    def numbers(self) -> int:
        """Numbers in its state, the integrator included, which is the last."""
        return len(self.state) + self.has_integrator


def _trace_state_feedback(tape: Tape, constants: Constants) -> TracedLaw:
    """Trace (8) with symbols for its numbers."""
    parameters = symbols(tape, len(constants.of_law))
    dt, k1, k2, k3, k4, limit = parameters
    inputs = symbols(tape, 4)  # x1, x2, x3, x_e
    law = StateFeedback(dt, (k1, k2, k3, k4), limit)  # type: ignore[arg-type]
    step = formula(tape, [*inputs, *parameters], law(*inputs))
    return TracedLaw(("x1", "x2", "x3"), (), (), True, None, step)


def _trace_law(tape: Tape, law: Law, extra_signals: int) -> TracedLaw:
    names = law_arguments(extra_signals)
    arguments = symbols(tape, len(names))
    y = Measurement(*arguments[:3])
    x1, x2, x3, *extra, held = arguments[3:]

    def step(before: Any) -> tuple[Any, Sequence[Any]]:
        after, u = law.step(before, y, feedback_state(x1, x2, x3, tuple(extra)), held)
        return after, (u,)

    part = _record(tape, law, "step(state, y, x, u)", step)
    has_integrator = hasattr(part.state, "x_e")
    integrator = [i for i, leaf in enumerate(part.leaves) if leaf.path == INTEGRATOR and has_integrator]
    if has_integrator and not integrator:
        raise InputError("its integrator x_e is no number in its state, where C would have it")
    needed = part.needed([*part.outputs, *(part.before[i] for i in integrator)])
    others = [i for i in needed if i not in integrator]
    kept = others + integrator
    init = part.init(kept)
    outputs = [*part.outputs, *(part.after[i] for i in kept)]
    used = _used(tape, names, arguments, outputs)
    return TracedLaw(
        tuple(used),
        tuple(_used(tape, MEASURED, part.first, [part.leaves[i].value for i in kept])),
        tuple(identifiers([part.leaves[i].path for i in others])),
        has_integrator,
        init,
        formula(tape, [*used.values(), *(part.before[i] for i in kept)], outputs),
    )


def _used(tape: Tape, names: Sequence[str], symbols: Sequence[Symbol], outputs: Sequence[Operand]) -> dict[str, Symbol]:
    """Select the symbols that a formula depends on: name -> symbol."""
    needed = tape.needed(map(tape.place, outputs))
    return {name: symbol for name, symbol in zip(names, symbols, strict=True) if symbol.place in needed}
