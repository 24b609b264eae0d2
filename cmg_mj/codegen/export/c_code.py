"""CasADi's algorithm of a function, printed as C of one precision.

CasADi writes C itself, but in single precision with constants and calls of `math.h` in double, and with an interface of
its own. Its algorithm is open instead: one operation after the other, each on numbers that are there already.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Literal, NamedTuple

import casadi
import numpy as np

from cmg_mj.errors import InputError

Precision = Literal["double", "single"]

WIDEST = 70
"""Characters: an expression that is longer is named, and the name goes on."""

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

SELECT = -1
"""Not CasADi's, which adds up (c ? a : 0) and (!c ? b : 0): c ? a : b."""

# C names an argument of these twice: it must be a name. Not fmax: that makes a limit of what is NaN, which would then
# go on as a number.
TEMPLATES = {
    casadi.OP_FMAX: ("{0} < {1} ? {1} : {0}", CHOICE),
    casadi.OP_FMIN: ("{0} > {1} ? {1} : {0}", CHOICE),
    casadi.OP_SIGN: ("{0} > {zero} ? {one} : {0} < {zero} ? -{one} : {0}", CHOICE),
    casadi.OP_SQ: ("{0} * {0}", TIMES),
    casadi.OP_TWICE: ("{0} + {0}", PLUS),
    casadi.OP_INV: ("{one} / {0}", TIMES),
    casadi.OP_NEG: ("-{0}", UNARY),
    casadi.OP_NOT: ("!{0}", UNARY),
    casadi.OP_IF_ELSE_ZERO: ("{0} ? {1} : {zero}", CHOICE),
    SELECT: ("{0} ? {1} : {2}", CHOICE),
}
NAMED_TWICE = {casadi.OP_FMAX, casadi.OP_FMIN, casadi.OP_SIGN, casadi.OP_SQ, casadi.OP_TWICE}

TRUTHS = {casadi.OP_LT, casadi.OP_LE, casadi.OP_EQ, casadi.OP_NE, casadi.OP_AND, casadi.OP_OR, casadi.OP_NOT}
"""Operations that are an int in C."""
ASKED = {casadi.OP_AND: 2, casadi.OP_OR: 2, casadi.OP_NOT: 1, casadi.OP_IF_ELSE_ZERO: 1, SELECT: 1}
"""Operations that take truths: how many of their arguments, from the first on."""


class Node(NamedTuple):
    """An operation of the algorithm.

    Attributes:
        operation: CasADi's number of it, or `SELECT`.
        arguments: Numbers of the nodes it takes; of an input its place.
        value: Of a constant.
    """

    operation: int
    arguments: tuple[int, ...]
    value: float = 0.0


class Text(NamedTuple):
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


def literal(value: float, precision: Precision) -> str:
    """A constant in C that is read as exactly this number, or in single precision as the float nearest to it.

    A number that is not zero stays one: what stands for "nearly zero" in double precision and would underflow becomes
    the smallest normal number, and what would overflow the largest.
    """
    if not math.isfinite(value):  # C's own are floats
        name = "NAN" if math.isnan(value) else "INFINITY"
        return f"{'-' if value < 0.0 else ''}{name if precision == 'single' else f'(double){name}'}"
    if precision == "double":
        return repr(float(value))
    kinds = np.finfo(np.float32)
    if value and not float(kinds.tiny) <= abs(value) <= float(kinds.max):
        value = math.copysign(float(kinds.tiny if abs(value) < 1.0 else kinds.max), value)
    return f"{np.float32(value)!s}f"


def body(
    function: casadi.Function, inputs: Sequence[str], outputs: Sequence[str], real: str, precision: Precision
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
    nodes, results = _algorithm(function)
    uses = _uses(nodes, results)
    texts: dict[int, Text] = {}
    lines: list[str] = []
    for i, node in enumerate(nodes):
        if not uses[i]:
            continue
        given: list[Text] = []
        if _is_operation(node):
            asked = ASKED.get(node.operation, 0)
            given = [texts[j] if k < asked else _number(nodes[j], texts[j], real) for k, j in enumerate(node.arguments)]
        text = _text(node, given, inputs, precision)
        named = _is_operation(node) and (
            len(uses[i]) > 1 or any(user in NAMED_TWICE for user in uses[i]) or len(text.text) > WIDEST
        )
        if named:
            name = f"t{len(lines) + 1}"
            lines.append(f"const {'int' if node.operation in TRUTHS else real} {name} = {text.text};")
            text = Text(name)
        texts[i] = text
    reads = re.compile("|".join(re.escape(name) for name in inputs) or r"(?!)")
    last = [_number(nodes[i], texts[i], real).text for i in results]
    for i, text in enumerate(last):
        if reads.search(text) and len(last) > 1:  # nothing is written before all is read
            last[i] = f"n{i}"
            lines.append(f"const {real} n{i} = {text};")
    return lines + [f"{place} = {text};" for place, text in zip(outputs, last, strict=True)]


def operations(function: casadi.Function) -> int:
    """How many operations a function takes."""
    nodes, results = _algorithm(function)
    uses = _uses(nodes, results)
    return sum(_is_operation(node) and bool(used) for node, used in zip(nodes, uses, strict=True))


def _algorithm(function: casadi.Function) -> tuple[list[Node], list[int]]:
    """Every operation, in order, and which nodes are the results."""
    nodes: list[Node] = []
    results: dict[int, int] = {}
    at: dict[int, int] = {}  # place in CasADi's work vector -> node
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        given, place = function.instruction_input(k), function.instruction_output(k)
        if operation == casadi.OP_OUTPUT:
            results[place[0]] = at[given[0]]
            continue
        if operation == casadi.OP_INPUT:
            node = Node(operation, (given[0],))
        elif operation == casadi.OP_CONST:
            node = Node(operation, (), function.instruction_constant(k))
        else:
            node = _selected(nodes, Node(operation, tuple(at[i] for i in given)))
        at[place[0]] = len(nodes)
        nodes.append(node)
    return nodes, [results[i] for i in sorted(results)]


def _selected(nodes: list[Node], node: Node) -> Node:
    """(c ? a : 0) + (!c ? b : 0) as c ? a : b, which is the same number."""
    if node.operation == casadi.OP_ADD:
        first, second = (nodes[i] for i in node.arguments)
        if first.operation == second.operation == casadi.OP_IF_ELSE_ZERO:
            condition, inverse = first.arguments[0], nodes[second.arguments[0]]
            if inverse.operation == casadi.OP_NOT and inverse.arguments == (condition,):
                return Node(SELECT, (condition, first.arguments[1], second.arguments[1]))
    return node


def _is_operation(node: Node) -> bool:
    return node.operation not in (casadi.OP_INPUT, casadi.OP_CONST)


def _uses(nodes: list[Node], results: list[int]) -> list[list[int]]:
    """For every node the operations that use it, as far as anything depends on them."""
    uses: list[list[int]] = [[] for _ in nodes]
    for i in results:
        uses[i].append(casadi.OP_OUTPUT)
    for i in range(len(nodes) - 1, -1, -1):
        if uses[i] and _is_operation(nodes[i]):
            for j in nodes[i].arguments:
                uses[j].append(nodes[i].operation)
    return uses


def _number(node: Node, text: Text, real: str) -> Text:
    """What may be a truth, as a number."""
    return Text(f"({real}){text.inside(ATOM)}", UNARY) if node.operation in TRUTHS else text


def _text(node: Node, given: list[Text], inputs: Sequence[str], precision: Precision) -> Text:
    """One operation on what is there."""
    operation, suffix = node.operation, "" if precision == "double" else "f"
    if operation == casadi.OP_INPUT:
        return Text(inputs[node.arguments[0]])
    if operation == casadi.OP_CONST:
        number = literal(node.value, precision)
        return Text(number, UNARY if number.startswith(("-", "(")) else ATOM)
    if operation in INFIX:
        sign, binds = INFIX[operation]
        left, right = given
        tight = binds if binds in (PLUS, TIMES) else UNARY  # the rest is read more easily in brackets
        return Text(f"{left.inside(tight)} {sign} {right.inside(min(tight, binds - 1))}", binds)
    if operation in CALLS:
        return Text(f"{CALLS[operation]}{suffix}({', '.join(x.text for x in given)})")
    if operation in TEMPLATES:
        template, binds = TEMPLATES[operation]
        tight = ATOM if binds == UNARY else UNARY if operation != SELECT else PLUS
        parts = [x.inside(tight) for x in given]
        return Text(template.format(*parts, zero=f"0.0{suffix}", one=f"1.0{suffix}"), binds)
    raise InputError(f"CasADi's operation {operation} is none that can be exported")
