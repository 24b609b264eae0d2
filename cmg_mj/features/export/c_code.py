"""Prints a formula as C of one precision, an operation of NumPy's after the other."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from cmg_mj.core.straight_line import ARGUMENT_TWICE
from cmg_mj.core.tape import CHOICE, CONSTANT, INPUT
from cmg_mj.features.export.formula import Formula

Precision = Literal["double", "single"]

MAX_WIDTH = 70
"""Longest expression [characters]; a longer one becomes a variable."""

ATOM, UNARY, TIMES, PLUS, COMPARED, EQUAL, AND, OR, CONDITIONAL = range(9)
"""Precedence of an expression's outermost operator in C, the tightest first."""

INFIX = {
    "add": ("+", PLUS),
    "subtract": ("-", PLUS),
    "multiply": ("*", TIMES),
    "divide": ("/", TIMES),
    "less": ("<", COMPARED),
    "less_equal": ("<=", COMPARED),
    "greater": (">", COMPARED),
    "greater_equal": (">=", COMPARED),
    "equal": ("==", EQUAL),
    "not_equal": ("!=", EQUAL),
    "logical_and": ("&&", AND),
    "logical_or": ("||", OR),
    "bitwise_and": ("&&", AND),  # of comparisons
    "bitwise_or": ("||", OR),
}

CALLED_ALIKE = """
    fabs sqrt exp expm1 log log1p sin cos tan sinh cosh tanh hypot copysign floor ceil rint fmod
    """.split()  # noqa: SIM905
CALLS = {
    **{name: name for name in CALLED_ALIKE},
    "absolute": "fabs",
    "power": "pow",
    "float_power": "pow",
    "arcsin": "asin",
    "arccos": "acos",
    "arctan": "atan",
    "arctan2": "atan2",
}
"""NumPy's function -> that of math.h."""

# Not fmax: it turns NaN into the limit, a number.
TEMPLATES = {
    "maximum": ("{0} < {1} ? {1} : {0}", CONDITIONAL),
    "minimum": ("{0} > {1} ? {1} : {0}", CONDITIONAL),
    "sign": ("{0} > {zero} ? {one} : {0} < {zero} ? -{one} : {0}", CONDITIONAL),
    "negative": ("-{0}", UNARY),
    "logical_not": ("!{0}", UNARY),
    "invert": ("!{0}", UNARY),
    CHOICE: ("{0} ? {1} : {2}", CONDITIONAL),
}

COMBINED = {"logical_and": 2, "logical_or": 2, "bitwise_and": 2, "bitwise_or": 2, "logical_not": 1, "invert": 1}
BOOLEAN_ARGUMENTS = {**COMBINED, CHOICE: 1}
"""Operation -> number of its leading arguments that are booleans."""
BOOLEANS = {"less", "less_equal", "greater", "greater_equal", "equal", "not_equal", *COMBINED}
"""Operations whose result is an int in C."""


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


def body(formula: Formula, inputs: Sequence[str], outputs: Sequence[str], real: str, precision: Precision) -> list[str]:
    """Print the body of a function.

    Args:
        formula: The formula.
        inputs: Names of its arguments in C.
        outputs: Places of its results in C. An output may have the place of an input.
        real: Name of the floating-point type.
        precision: Precision of constants and functions.

    Returns:
        Lines, not indented.
    """
    names = dict(zip(formula.inputs, inputs, strict=True))
    operations = formula.tape.operations
    texts: dict[int, Text] = {}
    lines: list[str] = []

    def number(place: int) -> Text:
        """Return the text of a number, to which a boolean is converted."""
        text = texts[place]
        return Text(f"({real}){text.inside(ATOM)}", UNARY) if operations[place].name in BOOLEANS else text

    for place, users in formula.tape.uses(formula.outputs).items():
        operation = operations[place]
        if operation.name == INPUT:
            texts[place] = Text(names[place])
            continue
        if operation.name == CONSTANT:
            constant = literal(operation.value, precision)
            texts[place] = Text(constant, UNARY if constant.startswith(("-", "(")) else ATOM)
            continue
        booleans = BOOLEAN_ARGUMENTS.get(operation.name, 0)
        arguments = [texts[i] if k < booleans else number(i) for k, i in enumerate(operation.arguments)]
        text = _text(operation.name, arguments, precision)
        if len(users) > 1 or users[0] in ARGUMENT_TWICE or len(text.text) > MAX_WIDTH:
            name = f"t{len(lines) + 1}"
            lines.append(f"const {'int' if operation.name in BOOLEANS else real} {name} = {text.text};")
            text = Text(name)
        texts[place] = text
    reads = re.compile("|".join(re.escape(name) for name in inputs) or r"(?!)")
    last = [number(place).text for place in formula.outputs]
    for i, text in enumerate(last):
        if reads.search(text) and len(last) > 1:  # nothing is written before all is read
            last[i] = f"n{i}"
            lines.append(f"const {real} n{i} = {text};")
    return lines + [f"{place} = {text};" for place, text in zip(outputs, last, strict=True)]


def _text(name: str, arguments: Sequence[Text], precision: Precision) -> Text:
    """Print one operation on its arguments."""
    suffix = "" if precision == "double" else "f"
    if name in INFIX:
        sign, precedence = INFIX[name]
        left, right = arguments
        tight = precedence if precedence in (PLUS, TIMES) else UNARY  # the rest is read more easily in brackets
        return Text(f"{left.inside(tight)} {sign} {right.inside(min(tight, precedence - 1))}", precedence)
    if name in CALLS:
        return Text(f"{CALLS[name]}{suffix}({', '.join(x.text for x in arguments)})")
    template, precedence = TEMPLATES[name]
    tight = ATOM if precedence == UNARY else UNARY if name != CHOICE else PLUS
    parts = [x.inside(tight) for x in arguments]
    return Text(template.format(*parts, zero=f"0.0{suffix}", one=f"1.0{suffix}"), precedence)
