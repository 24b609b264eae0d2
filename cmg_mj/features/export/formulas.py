"""Makes CasADi's functions from code that is called with symbols."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import casadi

from cmg_mj.core.errors import raised
from cmg_mj.features.export.source_location import NotExportable, raised_at
from cmg_mj.features.export.symbol import Symbol

Result = TypeVar("Result")

MEASURED = ("y1", "y2", "acceleration")
"""Names of an observer's measurements."""

MOST_NUMBERS = 1000
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
    place = {symbol.sx.name(): i for i, symbol in enumerate(symbols)}
    needed: set[int] = set()
    waiting = list(outputs)
    while waiting:
        for symbol in casadi.symvar(waiting.pop()):
            i = place.get(symbol.name())
            if i is not None and i not in needed:
                needed.add(i)
                waiting.append(next_state[i])
    return sorted(needed)


def symbols_named(names: Sequence[str]) -> list[Symbol]:
    """Make a symbol for each name."""
    return [Symbol(casadi.SX.sym(name)) for name in names]


def function_of(name: str, inputs: Sequence[Symbol], outputs: Sequence[casadi.SX]) -> casadi.Function:
    """Make a function of symbols.

    Raises:
        NotExportable: The outputs depend on other symbols.
    """
    arguments = [symbol.sx for symbol in inputs]
    function = casadi.Function(name, arguments, casadi.cse(list(outputs)) if outputs else [], {"allow_free": True})
    if function.has_free():
        raise NotExportable(
            "it remembers something outside of its state, in self or elsewhere, which C would not have: make it a part "
            "of the state that step returns"
        )
    return function


def call_traced(name: str, function: Callable[[], Result]) -> Result:
    """Call a user's code with symbols."""
    try:
        return function()
    except NotExportable:
        raise
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise NotExportable(f"{name} raised {raised(error)} {raised_at(error.__traceback__)}") from error
