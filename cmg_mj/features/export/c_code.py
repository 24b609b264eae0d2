"""Prints CasADi's algorithm of a function as C of one precision.

CasADi also writes C, but its single precision has constants and calls of `math.h` in double, and an interface of
CasADi's. Its algorithm is accessible: a sequence of operations, each on results of earlier ones.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Literal, NamedTuple

import casadi
import numpy as np

from cmg_mj.core.errors import InputError

Precision = Literal["double", "single"]

MAX_WIDTH = 70
"""Longest expression [characters]; a longer one becomes a variable."""

ATOM, UNARY, TIMES, PLUS, COMPARED, EQUAL, AND, OR, CHOICE = range(9)
"""Precedence of an expression's outermost operator in C, the tightest first."""

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

MATH = (
    *("fabs", "sqrt", "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh"),
    *("hypot", "copysign", "floor", "ceil", "fmod"),
)
"""Functions of math.h that CasADi and NumPy name alike."""
CALLS = {getattr(casadi, f"OP_{name.upper()}"): name for name in (*MATH, "pow", "asin", "acos", "atan", "atan2")}
CALLS[casadi.OP_CONSTPOW] = "pow"

SELECT = -1
"""c ? a : b, which CasADi writes as the sum of (c ? a : 0) and (!c ? b : 0)."""

# Not fmax: it turns NaN into the limit, a number.
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
ARGUMENT_TWICE = {casadi.OP_FMAX, casadi.OP_FMIN, casadi.OP_SIGN, casadi.OP_SQ, casadi.OP_TWICE}
"""Operations whose template has an argument twice; the argument must be a variable."""

BOOLEANS = {casadi.OP_LT, casadi.OP_LE, casadi.OP_EQ, casadi.OP_NE, casadi.OP_AND, casadi.OP_OR, casadi.OP_NOT}
"""Operations whose result is an int in C."""
BOOLEAN_ARGUMENTS = {casadi.OP_AND: 2, casadi.OP_OR: 2, casadi.OP_NOT: 1, casadi.OP_IF_ELSE_ZERO: 1, SELECT: 1}
"""Operation -> number of its leading arguments that are booleans."""


class Node(NamedTuple):
    """An operation of the algorithm.

    Attributes:
        operation: CasADi's number of the operation, or `SELECT`.
        arguments: Indices of the argument nodes; for an input, its place.
        value: Value of a constant.
    """

    operation: int
    arguments: tuple[int, ...]
    value: float = 0.0


class Text(NamedTuple):
    """A part of an expression in C.

    Attributes:
        text: The expression.
        precedence: Precedence of the outermost operator.
    """

    text: str
    precedence: int = ATOM

    def inside(self, loosest: int) -> str:
        """Print the expression, in brackets if it binds more loosely than `loosest`."""
        return self.text if self.precedence <= loosest else f"({self.text})"


def literal(value: float, precision: Precision) -> str:
    """Print a constant that C reads as exactly this number, or in single precision as the nearest float.

    In single precision a number that would underflow becomes the smallest normal number, because it stands for "nearly
    zero"; a number that would overflow becomes the largest.
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
    """Print the body of a function.

    Args:
        function: A function of scalars, with scalar results.
        inputs: Names of its arguments in C.
        outputs: Places of its results in C. An output may have the place of an input.
        real: Name of the floating-point type.
        precision: Precision of constants and functions.

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
        arguments: list[Text] = []
        if _is_operation(node):
            n = BOOLEAN_ARGUMENTS.get(node.operation, 0)
            arguments = [texts[j] if k < n else _number(nodes[j], texts[j], real) for k, j in enumerate(node.arguments)]
        text = _text(node, arguments, inputs, precision)
        is_variable = _is_operation(node) and (
            len(uses[i]) > 1 or any(user in ARGUMENT_TWICE for user in uses[i]) or len(text.text) > MAX_WIDTH
        )
        if is_variable:
            name = f"t{len(lines) + 1}"
            lines.append(f"const {'int' if node.operation in BOOLEANS else real} {name} = {text.text};")
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
    """Count the operations of a function."""
    nodes, results = _algorithm(function)
    uses = _uses(nodes, results)
    return sum(_is_operation(node) and bool(users) for node, users in zip(nodes, uses, strict=True))


def _algorithm(function: casadi.Function) -> tuple[list[Node], list[int]]:
    """List the operations in order, and the indices of the results."""
    nodes: list[Node] = []
    results: dict[int, int] = {}
    at: dict[int, int] = {}  # place in CasADi's work vector -> node
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        inputs, place = function.instruction_input(k), function.instruction_output(k)
        if operation == casadi.OP_OUTPUT:
            results[place[0]] = at[inputs[0]]
            continue
        if operation == casadi.OP_INPUT:
            node = Node(operation, (inputs[0],))
        elif operation == casadi.OP_CONST:
            node = Node(operation, (), function.instruction_constant(k))
        else:
            node = _as_select(nodes, Node(operation, tuple(at[i] for i in inputs)))
        at[place[0]] = len(nodes)
        nodes.append(node)
    return nodes, [results[i] for i in sorted(results)]


def _as_select(nodes: list[Node], node: Node) -> Node:
    """Replace (c ? a : 0) + (!c ? b : 0) by c ? a : b, which is the same number."""
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
    """List for each node the operations that use it, as far as a result depends on them."""
    uses: list[list[int]] = [[] for _ in nodes]
    for i in results:
        uses[i].append(casadi.OP_OUTPUT)
    for i in range(len(nodes) - 1, -1, -1):
        if uses[i] and _is_operation(nodes[i]):
            for j in nodes[i].arguments:
                uses[j].append(nodes[i].operation)
    return uses


def _number(node: Node, text: Text, real: str) -> Text:
    """Convert a boolean to a number; leave a number as it is."""
    return Text(f"({real}){text.inside(ATOM)}", UNARY) if node.operation in BOOLEANS else text


def _text(node: Node, arguments: list[Text], inputs: Sequence[str], precision: Precision) -> Text:
    """Print one operation on its arguments."""
    operation, suffix = node.operation, "" if precision == "double" else "f"
    if operation == casadi.OP_INPUT:
        return Text(inputs[node.arguments[0]])
    if operation == casadi.OP_CONST:
        number = literal(node.value, precision)
        return Text(number, UNARY if number.startswith(("-", "(")) else ATOM)
    if operation in INFIX:
        sign, precedence = INFIX[operation]
        left, right = arguments
        tight = precedence if precedence in (PLUS, TIMES) else UNARY  # the rest is read more easily in brackets
        return Text(f"{left.inside(tight)} {sign} {right.inside(min(tight, precedence - 1))}", precedence)
    if operation in CALLS:
        return Text(f"{CALLS[operation]}{suffix}({', '.join(x.text for x in arguments)})")
    if operation in TEMPLATES:
        template, precedence = TEMPLATES[operation]
        tight = ATOM if precedence == UNARY else UNARY if operation != SELECT else PLUS
        parts = [x.inside(tight) for x in arguments]
        return Text(template.format(*parts, zero=f"0.0{suffix}", one=f"1.0{suffix}"), precedence)
    raise InputError(f"CasADi's operation {operation} cannot be exported")
