"""Records the operations of a formula as data, which `straight_line` prints as Python and `export` as C.

NumPy hands its operators and functions over to a class with `__array_ufunc__` (NEP 13) and `__array_function__`
(NEP 18). Code written for arrays, such as the second branch of `arrays`, therefore takes symbols unchanged. Code
that no formula can express, such as `if y1 > 0.1:` or `math.sin(y1)`, asks the symbol for its value. The symbol then
raises `InputError` with the line of the user's file.
"""

from __future__ import annotations

import linecache
import math
import os
import sys
import traceback
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, NoReturn, TypeAlias

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from cmg_mj.core.arrays import Symbolic
from cmg_mj.core.errors import InputError

Operand: TypeAlias = "Symbol | float | np.generic | np.ndarray"

RECORDED = frozenset(
    """
    absolute fabs add subtract multiply divide negative sign maximum minimum power float_power copysign
    sqrt exp expm1 log log1p sin cos tan sinh cosh tanh arcsin arccos arctan arctan2 hypot floor ceil rint fmod
    less less_equal greater greater_equal equal not_equal
    logical_and logical_or logical_not bitwise_and bitwise_or invert
    """.split()  # noqa: SIM905
)
"""NumPy's functions that a tape takes, beside `where`, `clip`, `square` and `positive`."""

NO_LIMIT = {"maximum": -math.inf, "minimum": math.inf}
"""Limits that no number reaches."""
INPUT, CONSTANT, CHOICE = "input", "constant", "where"
"""Names of operations that are no function of NumPy's; of a choice the arguments are condition, yes, no."""


class Operation(NamedTuple):
    """An operation on earlier numbers of a tape.

    Attributes:
        name: NumPy's name of its function, or one of those above.
        arguments: Places of its arguments.
        value: A constant's value, or an input's name.
    """

    name: str
    arguments: tuple[int, ...] = ()
    value: Any = None


class Tape:
    """Operations in their order; equal ones are one.

    Args:
        worlds: Number of worlds of which each symbol is an array (n_worlds,); None for one world, on floats.

    Attributes:
        operations: The operations; a number's place is its operation's index.
        worlds: Number of worlds.
    """

    def __init__(self, worlds: int | None = None) -> None:
        self.worlds = worlds
        self.operations: list[Operation] = []
        self._places: dict[tuple, int] = {}

    def input(self, name: str) -> Symbol:
        """Append a number that is given."""
        return Symbol(self, self._append(Operation(INPUT, value=name)))

    def record(self, name: str, *arguments: Operand) -> Symbol:
        """Append an operation on numbers."""
        places = tuple(map(self.place, arguments))
        return Symbol(self, self._append(Operation(name, places)))

    def place(self, number: Operand) -> int:
        """Find the place of a symbol, or of a plain number, which becomes a constant.

        Raises:
            InputError: It is neither, or a symbol of another tape.
        """
        if type(number) is Symbol:
            if number.tape is not self:
                raise InputError(f"a number remembered from an earlier recording {here()}")
            return number.place
        if isinstance(number, np.ndarray):
            if number.ndim == 0:
                return self.place(number[()])
            if self.is_batched(number):
                return self._append(Operation(CONSTANT, value=number))
        if type(number) in (bool, int, float) or isinstance(number, (np.bool_, np.integer, np.floating)):
            return self._append(Operation(CONSTANT, value=float(number)))
        raise InputError(f"{type(number).__name__} where a real number belongs {here()}")

    def is_batched(self, number: Any) -> bool:
        """Return whether a constant has a number of each world."""
        return isinstance(number, np.ndarray) and number.shape == (self.worlds,)

    def needed(self, results: Iterable[int]) -> set[int]:
        """Find the operations on which results depend, themselves among them."""
        found: set[int] = set()
        waiting = list(results)
        while waiting:
            place = waiting.pop()
            if place not in found:
                found.add(place)
                waiting.extend(self.operations[place].arguments)
        return found

    def uses(self, results: Sequence[int]) -> dict[int, list[str]]:
        """List for each needed operation the names of those that use it; a result is a use of its own, ""."""
        uses: dict[int, list[str]] = {place: [] for place in sorted(self.needed(results))}
        for place in results:
            uses[place].append("")
        for place in uses:
            operation = self.operations[place]
            for argument in operation.arguments:
                uses[argument].append(operation.name)
        return uses

    def _append(self, operation: Operation) -> int:
        value = operation.value
        key = operation if value is None else (operation.name, repr(value))  # 0.0 and -0.0 differ
        if isinstance(value, np.ndarray):
            key = operation.name, id(value)
        place = self._places.get(key)
        if place is None:
            place = self._places[key] = len(self.operations)
            self.operations.append(operation)
        return place


class Symbol(Symbolic, NDArrayOperatorsMixin):
    """A number on a tape.

    Attributes:
        tape: The tape.
        place: Its place there.
    """

    __slots__ = ("place", "tape")

    def __init__(self, tape: Tape, place: int) -> None:
        self.tape = tape
        self.place = place

    def __repr__(self) -> str:
        return f"Symbol({self.place})"

    @property
    def is_array(self) -> bool:
        """See `Symbolic`."""
        return self.tape.worlds is not None

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Operand, **kwargs: Operand) -> Operand:
        if method != "__call__" or kwargs:
            raise InputError(f"numpy.{ufunc.__name__} with {', '.join(kwargs) or method} {here()}")
        if any(isinstance(x, np.ndarray) and x.ndim and not self.tape.is_batched(x) for x in inputs):
            return np.frompyfunc(partial(_applied, ufunc), ufunc.nin, 1)(*map(_boxed, inputs))
        return _applied(ufunc, *inputs)

    def __array_function__(
        self,
        function: Callable[..., Operand],
        types: Collection[type],
        args: tuple[Any, ...],
        kwargs: Mapping[str, Operand],
    ) -> Operand:
        if function is np.where and len(args) == 3 and not kwargs:
            return _chosen(*args)
        if function is np.clip and len(args) == 3 and not kwargs:
            return np.minimum(np.maximum(args[0], args[1]), args[2])
        raise InputError(f"numpy.{function.__name__} {here()}: it is not among the functions that can be exported")

    def __bool__(self) -> bool:
        raise InputError(
            f"a branch on a value {here()}: the exported C takes the same way always; use cmg_mj.core.arrays "
            "(where, clip, sign), or numpy.where"
        )

    def _number(self, *_: int | None) -> NoReturn:
        raise InputError(
            f"a plain number is asked for {here()}, as by float(), int(), round() or a function of math; use "
            "cmg_mj.core.arrays, or numpy's functions"
        )

    __float__ = __int__ = __index__ = __complex__ = __round__ = _number

    # NumPy calls these on every element of an object array.
    def sin(self) -> Symbol:
        """Sine."""
        return np.sin(self)  # pyright: ignore

    def cos(self) -> Symbol:
        """Cosine."""
        return np.cos(self)  # pyright: ignore

    def sqrt(self) -> Symbol:
        """Square root."""
        return np.sqrt(self)  # pyright: ignore

    def exp(self) -> Symbol:
        """Exponential."""
        return np.exp(self)  # pyright: ignore


def _applied(ufunc: np.ufunc, *inputs: Operand) -> Symbol:
    name = ufunc.__name__
    tape = _tape_of(inputs)
    if name == "square":
        return tape.record("multiply", *inputs, *inputs)
    if name == "positive":
        return Symbol(tape, tape.place(inputs[0]))
    if name not in RECORDED:
        raise InputError(f"numpy.{name} {here()}: it is not among the functions that can be exported")
    if name in ("maximum", "minimum") and not isinstance(inputs[0], Symbol):
        inputs = inputs[::-1]  # the operand that may be NaN comes first: `{1} if {0} < {1} else {0}` keeps it
    if type(inputs[-1]) is float and inputs[-1] == NO_LIMIT.get(name):
        return Symbol(tape, tape.place(inputs[0]))
    return tape.record(name, *inputs)


def _chosen(condition: Operand, yes: Operand, no: Operand) -> Operand:
    operands = condition, yes, no
    tape = _tape_of(operands)
    if any(isinstance(x, np.ndarray) and x.ndim and not tape.is_batched(x) for x in operands):
        return np.frompyfunc(_chosen, 3, 1)(*map(_boxed, operands))
    if not isinstance(condition, Symbol) and not tape.is_batched(condition):
        return yes if condition else no
    return tape.record(CHOICE, *operands)


def _tape_of(inputs: Sequence[Operand]) -> Tape:
    return next(x.tape for x in inputs if isinstance(x, Symbol))


def _boxed(x: Operand) -> Operand:
    """Wrap a symbol in an object array, which does not hand over again."""
    if not isinstance(x, Symbol):
        return x
    box = np.empty((), dtype=object)
    box[()] = x
    return box


_LIBRARY_PATHS = (
    __file__,
    str(Path(__file__).with_name("arrays.py")),
    str(Path(np.__file__).parent),
    str(Path(np.__file__).parents[1] / "scipy"),
    str(Path(__file__).parents[1] / "features" / "export"),
)


def here() -> str:
    """Locate the running line, the innermost one of a formula: `(own.py, line 12: if y1 > 0.1:)`."""
    return located(traceback.walk_stack(sys._getframe(1)))


def located(frames: Iterable[tuple[FrameType, int]]) -> str:
    """Locate the first line of a formula's own code among frames, the innermost first."""
    for frame, line in frames:
        file = frame.f_code.co_filename
        if not file.startswith(_LIBRARY_PATHS):
            text = linecache.getline(file, line).strip()
            return f"({min(os.path.relpath(file), file, key=len)}, line {line}{': ' if text else ''}{text})"
    return ""
