"""CasADi's algorithm of a function, printed as C of one precision.

CasADi writes C itself, but in single precision with constants and calls of `math.h` in double, and with an interface of
its own. Its algorithm is open instead: one operation after the other, each on numbers that are there already.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import casadi
import numpy as np

from cmg_mj.errors import InputError

Precision = Literal["double", "single"]

WIDEST = 100
"""Characters: what is longer gets a name of its own."""

ATOM, UNARY, TIMES, PLUS, COMPARED, EQUAL, AND, OR, CHOICE = range(9)
"""How tightly an expression's outermost operator binds in C, the tightest first."""

INFIX = {
    casadi.OP_ADD: ("+", PLUS),
    casadi.OP_SUB: ("-", PLUS),
    casadi.OP_MUL: ("*", TIMES),
    casadi.OP_DIV: ("/", TIMES),
    casadi.OP_LT: ("<", COMPARED),
    casadi.OP_LE: ("<=", COMPARED),
    casadi.OP_EQ: ("==", EQUAL),
    casadi.OP_NE: ("!=", EQUAL),
    casadi.OP_AND: ("&&", AND),
    casadi.OP_OR: ("||", OR),
}

CALLS = {
    casadi.OP_POW: "pow",
    casadi.OP_CONSTPOW: "pow",
    casadi.OP_FABS: "fabs",
    casadi.OP_SQRT: "sqrt",
    casadi.OP_EXP: "exp",
    casadi.OP_EXPM1: "expm1",
    casadi.OP_LOG: "log",
    casadi.OP_LOG1P: "log1p",
    casadi.OP_SIN: "sin",
    casadi.OP_COS: "cos",
    casadi.OP_TAN: "tan",
    casadi.OP_ASIN: "asin",
    casadi.OP_ACOS: "acos",
    casadi.OP_ATAN: "atan",
    casadi.OP_ATAN2: "atan2",
    casadi.OP_SINH: "sinh",
    casadi.OP_COSH: "cosh",
    casadi.OP_TANH: "tanh",
    casadi.OP_HYPOT: "hypot",
    casadi.OP_COPYSIGN: "copysign",
    casadi.OP_FLOOR: "floor",
    casadi.OP_CEIL: "ceil",
    casadi.OP_FMOD: "fmod",
}
"""Functions of math.h."""

TWICE_NAMED = {casadi.OP_FMAX: "<", casadi.OP_FMIN: ">", casadi.OP_SIGN: "", casadi.OP_SQ: "*", casadi.OP_TWICE: "+"}
"""Operations whose C names an argument twice, which therefore has a name."""

TRUTHS = {casadi.OP_LT, casadi.OP_LE, casadi.OP_EQ, casadi.OP_NE, casadi.OP_AND, casadi.OP_OR, casadi.OP_NOT}
"""Operations that are an int in C."""


def literal(value: float, precision: Precision) -> str:
    """A constant in C that is read as exactly this number, or in single precision as the float nearest to it.

    A number that is not zero stays one: what stands for "nearly zero" in double precision and would underflow becomes
    the smallest normal number, and likewise at the other end.
    """
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    if precision == "double":
        return repr(float(value))
    kinds = np.finfo(np.float32)
    if value and not float(kinds.tiny) <= abs(value) <= float(kinds.max):
        value = math.copysign(float(kinds.tiny if abs(value) < 1.0 else kinds.max), value)
    return f"{np.float32(value)!s}f"


@dataclass(frozen=True)
class Text:
    """A part of an expression in C.

    Attributes:
        text: As it is written.
        binds: How tightly.
    """

    text: str
    binds: int = ATOM

    def inside(self, loosest: int) -> str:
        """In brackets, if it binds more loosely than this."""
        return self.text if self.binds <= loosest else f"({self.text})"


def body(
    function: casadi.Function,
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    real: str,
    precision: Precision,
) -> list[str]:
    """The lines of a function in C.

    Args:
        function: Of scalars, with scalar results.
        inputs: What its arguments are called in C.
        outputs: Where its results go in C. An output may take the place of an input.
        real: The type's name.
        precision: Of constants and functions.

    Returns:
        Lines, not indented.
    """
    count = function.n_instructions()
    steps = [
        (function.instruction_id(k), function.instruction_input(k), function.instruction_output(k))
        for k in range(count)
    ]
    uses = _uses(steps)
    suffix = "" if precision == "double" else "f"
    work: dict[int, Text] = {}
    lines: list[str] = []
    results: dict[int, Text] = {}
    for k, (operation, given, place) in enumerate(steps):
        if operation == casadi.OP_OUTPUT:
            results[place[0]] = work[given[0]]
            continue
        if operation == casadi.OP_INPUT:
            text = Text(inputs[given[0]])
        elif operation == casadi.OP_CONST:
            number = literal(function.instruction_constant(k), precision)
            text = Text(number, UNARY if number.startswith("-") else ATOM)
        else:
            text = _operation(operation, [work[i] for i in given], suffix)
        if (text.binds != ATOM and operation != casadi.OP_CONST) or operation in CALLS:
            twice = any(steps[j][0] in TWICE_NAMED for j in uses[k])
            if len(uses[k]) > 1 or twice or len(text.text) > WIDEST:
                name = f"t{len(lines) + 1}"
                lines.append(f"const {'int' if operation in TRUTHS else real} {name} = {text.text};")
                text = Text(name)
        work[place[0]] = text
    inputs_read = re.compile("|".join(rf"{re.escape(name)}\b" for name in inputs) or r"(?!)")
    for i, text in results.items():  # nothing is written before all is read
        if inputs_read.search(text.text) and len(results) > 1:
            lines.append(f"const {real} n{i} = {text.text};")
            results[i] = Text(f"n{i}")
    return lines + [f"{outputs[i]} = {results[i].text};" for i in sorted(results)]


def _uses(steps: list) -> list[list[int]]:
    """For every instruction those that use its result."""
    maker: dict[int, int] = {}
    uses: list[list[int]] = [[] for _ in steps]
    for k, (operation, given, place) in enumerate(steps):
        if operation not in (casadi.OP_INPUT, casadi.OP_CONST):
            for i in given:
                uses[maker[i]].append(k)
        if operation != casadi.OP_OUTPUT and place:
            maker[place[0]] = k
    return uses


def _operation(operation: int, given: list[Text], suffix: str) -> Text:
    """One operation on what is there."""
    if operation in INFIX:
        sign, binds = INFIX[operation]
        left, right = given
        # Two comparisons in a row, and what stands right, are put in brackets: C reads from the left.
        strict = binds if binds in (PLUS, TIMES) else UNARY
        return Text(f"{left.inside(strict)} {sign} {right.inside(min(strict, binds) - 1)}", binds)
    if operation in CALLS:
        return Text(f"{CALLS[operation]}{suffix}({', '.join(x.text for x in given)})")
    first = given[0]
    zero = f"0.0{suffix}"
    if operation == casadi.OP_IF_ELSE_ZERO:
        return Text(f"{first.inside(UNARY)} ? {given[1].inside(PLUS)} : {zero}", CHOICE)
    if operation in (casadi.OP_FMAX, casadi.OP_FMIN):
        # Not fmax: it makes a limit of what is NaN, which would go on as a number.
        a, b = first.inside(UNARY), given[1].inside(UNARY)
        return Text(f"{a} {TWICE_NAMED[operation]} {b} ? {b} : {a}", CHOICE)
    if operation == casadi.OP_SIGN:
        a = first.inside(UNARY)
        return Text(f"{a} > {zero} ? 1.0{suffix} : {a} < {zero} ? -1.0{suffix} : {a}", CHOICE)
    if operation == casadi.OP_NEG:
        return Text(f"-{first.inside(ATOM)}", UNARY)
    if operation == casadi.OP_NOT:
        return Text(f"!{first.inside(ATOM)}", UNARY)
    if operation in (casadi.OP_SQ, casadi.OP_TWICE):
        a = first.inside(UNARY)
        return Text(f"{a} {TWICE_NAMED[operation]} {a}", PLUS if operation == casadi.OP_TWICE else TIMES)
    if operation == casadi.OP_INV:
        return Text(f"1.0{suffix} / {first.inside(UNARY)}", TIMES)
    raise InputError(f"CasADi's operation {operation} is none that can be exported")
