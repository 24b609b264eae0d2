"""A symbolic number, which records the operations of an observer's code as CasADi's graph.

NumPy hands its operators and functions over to a class with `__array_ufunc__` (NEP 13) and `__array_function__`
(NEP 18). Code written for arrays, such as the second branch of `elementwise`, therefore takes symbols unchanged. Code
that no formula can express, such as `if y1 > 0.1:` or `math.sin(y1)`, asks the symbol for its value. The symbol then
raises `InputError` with the line of the user's file.
"""

from __future__ import annotations

import linecache
import os
import sys
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, TypeAlias, TypeVar

import casadi
import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from cmg_mj.core.arrays import Symbolic
from cmg_mj.core.errors import InputError, raised
from cmg_mj.features.export.c_code import MATH
from cmg_mj.linear.slopes import needed_states

Operand: TypeAlias = "Symbol | float | np.generic | np.ndarray"

OPERATIONS: dict[np.ufunc, int] = {
    getattr(np, name): getattr(casadi, f"OP_{operation.upper()}")
    for name, operation in {
        **dict(zip(MATH, MATH, strict=True)),
        **{"add": "add", "subtract": "sub", "multiply": "mul", "divide": "div", "negative": "neg", "sign": "sign"},
        **{"power": "pow", "float_power": "pow", "absolute": "fabs", "maximum": "fmax", "minimum": "fmin"},
        **{"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2"},
        **{"less": "lt", "less_equal": "le", "equal": "eq", "not_equal": "ne"},
        **{"logical_and": "and", "logical_or": "or", "logical_not": "not"},
        **{"bitwise_and": "and", "bitwise_or": "or", "invert": "not"},  # of comparisons
    }.items()
}
"""NumPy's function -> CasADi's operation."""

EXCHANGED = {np.greater: np.less, np.greater_equal: np.less_equal}
"""NumPy's function -> the function with the same result for exchanged arguments."""


class Symbol(Symbolic, NDArrayOperatorsMixin):
    """A symbolic number.

    Attributes:
        sx: CasADi's expression of the number.
    """

    __slots__ = ("sx",)

    def __init__(self, sx: casadi.SX) -> None:
        self.sx = sx

    def __repr__(self) -> str:
        return f"Symbol({self.sx})"

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Operand, **kwargs: Operand) -> Operand:
        if method != "__call__" or kwargs:
            raise InputError(f"numpy.{ufunc.__name__} with {', '.join(kwargs) or method} {here()}")
        if any(isinstance(x, np.ndarray) and x.ndim for x in inputs):
            return np.frompyfunc(partial(_apply, ufunc), ufunc.nin, 1)(*map(_boxed, inputs))
        return _apply(ufunc, *inputs)

    def __array_function__(
        self,
        function: Callable[..., Operand],
        types: Collection[type],
        args: tuple[Any, ...],
        kwargs: Mapping[str, Operand],
    ) -> Operand:
        if function is np.where and len(args) == 3 and not kwargs:
            return _where(*args)
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


def expression(x: Operand | Symbolic) -> casadi.SX:
    """Convert a symbol or a plain number to CasADi's expression.

    Raises:
        InputError: The operand is neither.
    """
    if isinstance(x, np.ndarray) and x.ndim == 0:
        x = x[()]
    if isinstance(x, Symbol):
        return x.sx
    if isinstance(x, (bool, int, float, np.bool_, np.integer, np.floating)):
        return casadi.SX(float(x))
    raise InputError(f"{type(x).__name__} where a real number belongs {here()}")


def _boxed(x: Operand) -> Operand:
    """Wrap a symbol in an object array, which does not hand over again."""
    if not isinstance(x, Symbol):
        return x
    box = np.empty((), dtype=object)
    box[()] = x
    return box


def _apply(ufunc: np.ufunc, *inputs: Operand) -> Symbol:
    if ufunc in EXCHANGED:
        return _apply(EXCHANGED[ufunc], *reversed(inputs))
    if ufunc is np.square:
        return _apply(np.multiply, *inputs, *inputs)
    if ufunc is np.positive:
        return Symbol(expression(inputs[0]))
    operation = OPERATIONS.get(ufunc)
    if operation is None:
        raise InputError(f"numpy.{ufunc.__name__} {here()}: it is not among the functions that can be exported")
    if ufunc in (np.maximum, np.minimum) and not isinstance(inputs[0], Symbol):
        inputs = inputs[::-1]  # the operand that may be NaN comes first: see `c_code`
    make = casadi.SX.unary if len(inputs) == 1 else casadi.SX.binary
    return Symbol(make(operation, *map(expression, inputs)))


def _where(condition: Operand, a: Operand, b: Operand) -> Operand:
    if any(isinstance(x, np.ndarray) and x.ndim for x in (condition, a, b)):
        return np.frompyfunc(_where, 3, 1)(*map(_boxed, (condition, a, b)))
    test, yes, no = map(expression, (condition, a, b))
    first = casadi.SX.binary(casadi.OP_IF_ELSE_ZERO, test, yes)
    second = casadi.SX.binary(casadi.OP_IF_ELSE_ZERO, casadi.SX.unary(casadi.OP_NOT, test), no)
    return Symbol(casadi.SX.binary(casadi.OP_ADD, first, second))


Result = TypeVar("Result")

MEASURED = ("y1", "y2", "acceleration")
GYRO = "gyro"
"""Names of an observer's measurements."""

MAX_NUMBERS = 1000
"""Largest state: 4 kB on a board in single precision. More is not meant for a board, and takes CasADi minutes."""


@contextmanager
def as_written() -> Iterator[None]:
    """Turn CasADi's simplifications off: a simplified formula may round otherwise."""
    before = casadi.GlobalOptions.getSimplificationOnTheFly()
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(before)


def needed_numbers(
    symbols: Sequence[Symbol], next_state: Sequence[casadi.SX], outputs: Sequence[casadi.SX]
) -> list[int]:
    """Find the numbers of a state that an estimate depends on, now or later; a state may hold unused measurements."""
    names = [symbol.sx.name() for symbol in symbols]

    def depends(expressions: Sequence[casadi.SX]) -> np.ndarray:
        used = [{symbol.name() for symbol in casadi.symvar(each)} for each in expressions]
        return np.array([[name in its for name in names] for its in used]).reshape(len(used), len(names))

    return np.flatnonzero(needed_states(depends(next_state), depends(outputs))).tolist()


def symbols_named(names: Sequence[str]) -> list[Symbol]:
    """Make a symbol for each name."""
    return [Symbol(casadi.SX.sym(name)) for name in names]


def function_of(name: str, inputs: Sequence[Symbol], outputs: Sequence[casadi.SX]) -> casadi.Function:
    """Make a function of symbols.

    Raises:
        InputError: The outputs depend on other symbols.
    """
    arguments = [symbol.sx for symbol in inputs]
    function = casadi.Function(name, arguments, casadi.cse(list(outputs)) if outputs else [], {"allow_free": True})
    if function.has_free():
        raise InputError(
            "it remembers something outside of its state, in self or elsewhere, which C would not have: make it a part "
            "of the state that step returns"
        )
    return function


COMPILED = (
    ": compiled routines of numpy and scipy take no symbols; write it out in + - * /, as the inverse of "
    "[[a, b], [c, d]]: [[d, -b], [-c, a]] / (a*d - b*c)"
)


def call_traced(name: str, function: Callable[[], Result]) -> Result:
    """Call a user's code with symbols."""
    try:
        return function()
    except (InputError, KeyboardInterrupt):
        raise
    except BaseException as error:
        walked = reversed(list(traceback.walk_tb(error.__traceback__)))
        text = raised(error)
        cure = COMPILED if "from dtype('O')" in text or "object arrays" in text else ""
        raise InputError(f"{name} raised {text} {_locate(walked)}{cure}") from error


_LIBRARY_PATHS = (
    str(Path(__file__).parent),
    str(Path(np.__file__).parent),
    str(Path(np.__file__).parents[1] / "scipy"),
    str(Path(__file__).parents[2] / "core" / "arrays.py"),
)


class LawNotExportable(InputError):
    """A control law that cannot be exported; all else is the observer's."""


def here() -> str:
    """Locate the running line, the innermost one outside this package: `(own.py, line 12: if y1 > 0.1:)`."""
    return _locate(traceback.walk_stack(sys._getframe(1)))


def _locate(frames: Iterable[tuple[FrameType, int]]) -> str:
    """Locate the first line of the user's code among frames, the innermost first."""
    for frame, line in frames:
        file = frame.f_code.co_filename
        if not file.startswith(_LIBRARY_PATHS):
            text = linecache.getline(file, line).strip()
            return f"({min(os.path.relpath(file), file, key=len)}, line {line}{': ' if text else ''}{text})"
    return ""
