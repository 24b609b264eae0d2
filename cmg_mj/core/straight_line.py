"""Prints what a pure function did as straight-line Python: its operations alone, to the last bit.

A tick of one world is a chain of small functions, whose calls take longer than the arithmetic. Recorded once and
printed, it takes half the time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NoReturn, Self

import numpy as np

from cmg_mj.core import arrays
from cmg_mj.core.errors import InputError
from cmg_mj.core.tape import CHOICE, CONSTANT, INPUT, Symbol, Tape

SAME_IN_MATH = ("sqrt", "exp", "sin", "cos")
PYTHON = {
    **{name: f"{name}({{0}})" for name in SAME_IN_MATH},
    "copysign": "copysign({0}, {1})",
    "add": "{0} + {1}",
    "subtract": "{0} - {1}",
    "multiply": "{0} * {1}",
    "divide": "{0} / {1}",
    "negative": "-{0}",
    "absolute": "abs({0})",
    "sign": "float(({0} > 0.0) - ({0} < 0.0))",
    "maximum": "{1} if {0} < {1} else {0}",
    "minimum": "{1} if {0} > {1} else {0}",
    "power": "{0} ** {1}",
    "float_power": "{0} ** {1}",
    "arctan2": "atan2({0}, {1})",
    "rint": "round({0})",
    "less": "{0} < {1}",
    "less_equal": "{0} <= {1}",
    "greater": "{0} > {1}",
    "greater_equal": "{0} >= {1}",
    "equal": "{0} == {1}",
    "not_equal": "{0} != {1}",
    "logical_and": "bool({0} and {1})",
    "logical_or": "bool({0} or {1})",
    "logical_not": "not {0}",
    "bitwise_and": "{0} and {1}",
    "bitwise_or": "{0} or {1}",
    "invert": "not {0}",
    CHOICE: "{1} if {0} else {2}",
}
"""NumPy's function -> Python on floats, which rounds as `arrays` does on them; `math` rounds `hypot` otherwise."""
ON_ARRAYS = {
    **PYTHON,
    **{name: f"{name}({{0}})" for name in ("sqrt", "exp", "sin", "cos", "sign", "rint")},
    **{name: f"{name}({{0}}, {{1}})" for name in ("copysign", "float_power", "maximum", "minimum")},
    "power": "float_power({0}, {1})",
    "arctan2": "atan2({0}, {1})",
    "logical_and": "{0} & {1}",
    "logical_or": "{0} | {1}",
    "bitwise_and": "{0} & {1}",
    "bitwise_or": "{0} | {1}",
    "logical_not": "~{0}",
    "invert": "~{0}",
    CHOICE: "where({0}, {1}, {2})",
}
"""NumPy's function -> Python on arrays; what rounds otherwise than the C library is `arrays`' own."""
CALLED_ON_ARRAYS = {
    **{name: getattr(np, name) for name in ("sqrt", "sin", "cos", "sign", "rint", "where")},
    **{name: getattr(np, name) for name in ("copysign", "float_power", "maximum", "minimum")},
    "exp": arrays.exp,
    "atan2": arrays.atan2,
}
ARGUMENT_TWICE = ("sign", "maximum", "minimum")
LONGEST = 120
"""Longest expression that is written where it is used [characters]."""

Tables = Mapping[Any, Callable[[int], Sequence[Any]]]
"""Numbers that are looked up and not computed, such as noise: key -> function of a number, such as a sample's."""


class Count(int):
    """A whole number while a function is recorded: it is looked up with, and it is counted on. Nothing else.

    What is computed with it, or decided by its size, would be baked into the straight line.
    """

    text: str

    def __new__(cls, value: int, text: str) -> Self:
        """Make a count of an input's name."""
        count = super().__new__(cls, value)
        count.text = text
        return count

    def __add__(self, more: int) -> Self:
        return type(self)(int(self) + int(more), f"{self.text} + {int(more)}")

    __radd__ = __add__

    def _refuse(self, *_: Any) -> NoReturn:
        raise InputError(f"the whole number {self.text} is computed with, or decides something")

    __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _refuse
    __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = __pow__ = __float__ = _refuse
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _refuse
    __hash__ = int.__hash__


class Phase(Count):
    """The physics step: what is due at it comes again after a common period."""

    __sub__, __mod__, __floordiv__ = int.__sub__, int.__mod__, int.__floordiv__


class _Recorder:
    """Replaces the numbers of trees by symbols, and prints the function.

    Args:
        worlds: Number of worlds, on arrays; None for one, on floats.
    """

    def __init__(self, worlds: int | None) -> None:
        self.tape = Tape(worlds)
        self.lines: list[str] = []
        self.endings: list[str] = []
        self.known: dict[str, Any] = {**vars(math), "new": tuple.__new__}
        if worlds is not None:
            self.known |= CALLED_ON_ARRAYS
        self._inputs = 0
        self._draws: dict[tuple[Any, str], Sequence[Symbol]] = {}

    def _name(self, letter: str) -> str:
        self._inputs += 1
        return f"{letter}{self._inputs}"

    def given(self, tree: Any) -> tuple[str, Any]:
        """Return a pattern of names for a tree, and the tree with symbols and counts in the place of its numbers."""
        if type(tree) is float or self.tape.is_batched(tree):
            name = self._name("x")
            return name, self.tape.input(name)
        if isinstance(tree, np.ndarray) and tree.ndim == 2:
            return self.given(list(tree))
        if type(tree) is int:
            name = self._name("i")
            return name, Count(tree, name)
        if tree is None:
            name = self._name("v")
            self.lines.append(f"if {name} is not None: raise ValueError")
            return name, None
        if type(tree) is not list and not isinstance(tree, tuple):
            raise InputError(f"{type(tree).__name__}: a straight line takes floats and whole numbers alone")
        if not tree:
            return "()", tree
        patterns, parts = zip(*map(self.given, tree), strict=True)
        pattern = f"({', '.join(patterns)},)"
        if type(tree) in (tuple, list):
            return pattern, type(tree)(parts)
        kind: Any = type(tree)
        made = tuple.__new__(kind, parts)
        if more := getattr(tree, "__dict__", {}):
            whole = self._name("y")
            self.lines.append(f"{pattern} = {whole}")
            for key, value in more.items():
                inner, part = self.given(value)
                self.lines.append(f"{inner} = {whole}.{key}")
                setattr(made, key, part)
            return whole, made
        return pattern, made

    def argument(self, tree: Any) -> tuple[str, Any]:
        """Return the same for a whole argument: a whole number is the physics step."""
        if type(tree) is not int:
            return self.given(tree)
        name = self._name("i")
        return name, Phase(tree, name)

    def table(self, key: Any, channels: Callable[[int], Sequence[Any]]) -> Callable[[int], Sequence[Any]]:
        """Return what looks up in a table while the function is recorded."""

        def look_up(number: int) -> Sequence[Any]:
            if not isinstance(number, Count):
                raise InputError(f"a table is looked up at {number}, which is no input")
            looked = key, number.text
            if looked not in self._draws:
                width = len(channels(int(number)))
                names = [self._name("n") for _ in range(width)]
                table = self._constant(key)
                self.lines.append(f"({', '.join(names)},) = tables[{table}]({number.text})")
                self._draws[looked] = list(map(self.tape.input, names))
            return self._draws[looked]

        return look_up

    def _constant(self, value: Any) -> str:
        if value is None or type(value) in (bool, int, str):
            return repr(value)
        name = f"k{len(self.known)}"
        self.known[name] = value
        return name

    def printed(self, tree: Any, texts: Mapping[int, str]) -> str:
        """Print the expression of a tree of results."""
        if isinstance(tree, Symbol):
            return texts[tree.place]
        if isinstance(tree, Count):
            return tree.text
        if type(tree) is float:
            return _literal(tree)
        if type(tree) is int:
            raise InputError(f"the whole number {tree} is computed, and not counted on")
        if not isinstance(tree, (tuple, list)):
            return self._constant(tree)
        parts = [self.printed(part, texts) for part in tree]
        if type(tree) is list:
            return f"[{', '.join(parts)}]"
        whole = f"({', '.join(parts)}{',' if parts else ''})"
        if type(tree) is tuple:
            return whole
        kind = self._constant(type(tree))
        more = getattr(tree, "__dict__", {})
        if not more:
            return f"new({kind}, {whole})"
        name = self._name("m")
        self.endings.append(f"{name} = new({kind}, {whole})")
        self.endings += [f"{name}.{key} = {self.printed(value, texts)}" for key, value in more.items()]
        return name


def straight_line(
    function: Callable[..., Any],
    trees: Sequence[Any],
    tables: Tables,
    worlds: int | None = None,
    finite: Callable[[Any], Sequence[Any]] | None = None,
) -> Callable[..., Any]:
    """Record a pure function and return it as straight-line Python.

    The result takes trees of the same form as the given ones, with other numbers, and other tables. It raises
    `ArithmeticError` or `ValueError` where the function on floats may do otherwise.

    Args:
        function: Takes the trees and the tables. It has no branch on a float.
        trees: Arguments to record it with: floats, and whole numbers that are counted on, in tuples and lists; of many
            worlds arrays (n_worlds,) or (channels, n_worlds) in the place of floats. A whole number by itself is the
            physics step, whose remainders and quotients come again where the straight line is called.
        tables: Tables to record it with.
        worlds: Number of worlds, on arrays; None for one, on floats.
        finite: Selects the numbers of its result that must be finite: the straight line raises `ArithmeticError` where
            one is not.

    Returns:
        The function.

    Raises:
        InputError: The function cannot be recorded.
    """
    recorder = _Recorder(worlds)
    patterns, arguments = zip(*(recorder.argument(tree) for tree in trees), strict=True)
    result = function(*arguments, {key: recorder.table(key, table) for key, table in tables.items()})
    places = [symbol.place for symbol in _symbols(result)]
    texts, body = print_operations(recorder.tape, places, PYTHON if worlds is None else ON_ARRAYS, recorder.known)
    names = [f"a{i}" for i in range(len(trees))]
    unpacked = [f"{pattern} = {name}" for pattern, name in zip(patterns, names, strict=True)]
    checked = [texts[symbol.place] for symbol in _symbols(finite(result) if finite else ())]
    check = [f"if not abs({' + '.join(checked)}) < inf: raise ArithmeticError"] if checked else []
    returned = recorder.printed(result, texts)
    lines = [*unpacked, *_ordered(recorder.lines), *body, *check, *recorder.endings, f"return {returned}"]
    return compiled(function.__qualname__, [*names, "tables"], lines, recorder.known)


def compiled(name: str, parameters: Sequence[str], lines: Sequence[str], known: dict[str, Any]) -> Callable[..., Any]:
    """Compile the printed body of a function; `known` has what it calls, and is added to."""
    source = f"def run({', '.join(parameters)}):\n" + "".join(f"    {line}\n" for line in lines)
    exec(compile(source, f"<{name}, printed>", "exec"), known)
    return known["run"]


def _ordered(lines: Sequence[str]) -> list[str]:
    """Bring what unpacks a part behind what names it: an inner part's lines were written first."""
    looked_up = [line for line in lines if "tables[" in line]
    checks = [line for line in lines if line.startswith("if ")]
    unpacking = [line for line in lines if line not in looked_up and line not in checks]
    return [*reversed(unpacking), *checks, *looked_up]


def _symbols(tree: Any) -> Iterable[Symbol]:
    if isinstance(tree, Symbol):
        yield tree
    elif isinstance(tree, (tuple, list)):
        for part in (*tree, *getattr(tree, "__dict__", {}).values()):
            yield from _symbols(part)


def print_operations(
    tape: Tape, results: Sequence[int], words: Mapping[str, str] = PYTHON, known: dict[str, Any] | None = None
) -> tuple[dict[int, str], list[str]]:
    """Print the operations that results need as Python.

    Args:
        tape: The tape; an input's name is a name in Python.
        results: Places of the results.
        words: NumPy's function -> its expression, in which `{0}` is its first argument.
        known: Where constants go that are arrays, by their names.

    Returns:
        The text of each place, and the lines before the results.

    Raises:
        InputError: An operation is not among the words.
    """
    texts: dict[int, str] = {}
    lines: list[str] = []
    for place, users in tape.uses(results).items():
        operation = tape.operations[place]
        if operation.name == INPUT:
            texts[place] = operation.value
        elif operation.name == CONSTANT and isinstance(operation.value, np.ndarray):
            texts[place] = f"c{place}"
            known[texts[place]] = operation.value  # pyright: ignore[reportOptionalSubscript]
        elif operation.name == CONSTANT:
            texts[place] = _literal(operation.value)
        else:
            template = words.get(operation.name)
            if template is None:
                raise InputError(f"{operation.name}: is not printed as Python")
            text = template.format(*(texts[argument] for argument in operation.arguments))
            if len(users) == 1 and len(text) < LONGEST and users[0] not in ARGUMENT_TWICE:
                texts[place] = f"({text})"
            else:
                texts[place] = f"t{place}"
                lines.append(f"t{place} = {text}")
    return texts, lines


def _literal(value: float) -> str:
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text
