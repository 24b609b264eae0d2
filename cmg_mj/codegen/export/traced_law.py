"""Traces any control law, and prints it as C functions on a row of numbers."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import NamedTuple

import casadi
import numpy as np

from cmg_mj.codegen.export.c_code import body
from cmg_mj.codegen.export.pytree import form, numbers, rebuild
from cmg_mj.codegen.export.source_location import NotExportable
from cmg_mj.codegen.export.symbol import Symbol, expression
from cmg_mj.codegen.export.trace import MEASURED, as_written, call_traced, function_of, needed_numbers, symbols_named
from cmg_mj.controllers.laws.protocol import FeedbackState, Law, feedback_state
from cmg_mj.errors import InputError
from cmg_mj.observers.protocol import Measurement

COMPARED = 200
"""Decisions on which a traced law is compared with Python."""
LARGEST_SHARE = 1e-9
"""Share of its largest value by which a traced law may be off."""


class TracedLaw(NamedTuple):
    """A law's formulas.

    Attributes:
        paths: Names of the numbers in its state that u depends on, and of its integrator.
        init: (y1, y2, acceleration) -> state.
        step: (state, y1, y2, acceleration, x, held u) -> state, u.
        parts: Numbers in x: what is fed back, then the observer's extra signals.
    """

    paths: tuple[str, ...]
    init: casadi.Function
    step: casadi.Function
    parts: int

    @property
    def integrator(self) -> int:
        """Index of the integrator in the state; -1 without one."""
        return self.paths.index("x_e") if "x_e" in self.paths else -1

    def c_init(self) -> list[str]:
        """Print the body of `init(double *memory, const double *y)`."""
        places = [f"memory[{i}]" for i in range(len(self.paths))]
        return body(self.init, _row("y", 3), places, "double", "double")

    def c_step(self) -> list[str]:
        """Print the body of `step(double *memory, const double *y, const double *x, double held, double *u)`."""
        places = [f"memory[{i}]" for i in range(len(self.paths))]
        inputs = [*places, *_row("y", 3), *_row("x", self.parts), "held"]
        return body(self.step, inputs, [*places, "*u"], "double", "double")


def trace_law(law: Law, extra_signals: int) -> TracedLaw:
    """Trace a law and compare the formulas with Python on random numbers.

    Args:
        law: The law.
        extra_signals: Number of signals that the observer estimates beyond x.

    Returns:
        The formulas.

    Raises:
        InputError: A formula cannot express what the law does, or is not what Python runs.
    """
    name = type(law).__name__
    try:
        with as_written():
            traced = _trace(copy.deepcopy(law), 3 + extra_signals)
        _compare(copy.deepcopy(law), traced)
    except InputError as error:
        raise InputError(f"law {name}: cannot be exported: {error}") from error
    return traced


def _row(name: str, n: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(n)]


def _trace(law: Law, parts: int) -> TracedLaw:
    first = symbols_named(MEASURED)
    state = call_traced("init(y)", lambda: law.init(Measurement(*first)))
    leaves = list(numbers(state))
    symbols = symbols_named([f"state {i}" for i in range(len(leaves))])
    y, x, (held,) = symbols_named(MEASURED), symbols_named(_row("x", parts)), symbols_named(["held"])
    before = rebuild(state, iter(symbols))
    after, u = call_traced("step(state, y, x, u)", lambda: law.step(before, Measurement(*y), _fed_back(x), held))
    if form(after) != form(state):
        raise NotExportable("its step returns a state that is made otherwise than the one of init")
    next_state = [expression(leaf.value) for leaf in numbers(after)]
    needed = set(needed_numbers(symbols, next_state, [expression(u)]))
    needed |= {i for i, leaf in enumerate(leaves) if leaf.path == ("x_e",)}
    kept = sorted(needed)
    init = function_of("init", first, [expression(leaves[i].value) for i in kept])
    inputs = [*(symbols[i] for i in kept), *y, *x, held]
    step = function_of("step", inputs, [*(next_state[i] for i in kept), expression(u)])
    return TracedLaw(tuple(".".join(leaves[i].path) for i in kept), init, step, parts)


def _fed_back(x: Sequence[Symbol | float]) -> FeedbackState:
    return feedback_state(x[0], x[1], x[2], tuple(x[3:]))


def _compare(law: Law, traced: TracedLaw) -> None:
    """Compare the formulas with Python, on random measurements and feedback."""
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(COMPARED, 3 + traced.parts)) * np.array([0.05, 0.3, 1.0, 0.05, *[0.3] * (traced.parts - 1)])
    held, state, ours, theirs, memory = 0.0, None, [], [], []
    for row in rows.tolist():
        y, x = Measurement(*row[:3]), row[3:]
        if state is None:
            state = law.init(y)
            memory = [float(value) for value in traced.init.call(row[:3])]
        state, u = law.step(state, y, _fed_back(x), held)
        *memory, traced_u = (float(value) for value in traced.step.call([*memory, *row[:3], *x, held]))
        held = float(u)
        ours.append(traced_u)
        theirs.append(held)
    off = np.abs(np.subtract(ours, theirs)).max()
    if not off <= LARGEST_SHARE * np.abs(theirs).max():
        raise InputError(
            f"traced, it is not what Python runs: on random numbers u is off by {off:.3g}. Does it look at the type of "
            "a number, or remember something outside of its state?"
        )
