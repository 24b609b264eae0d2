"""A formula: the part of a tape that leads from given numbers to results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from cmg_mj.core.errors import InputError
from cmg_mj.core.tape import CONSTANT, INPUT, Operand, Symbol, Tape


class Formula(NamedTuple):
    """A formula.

    Attributes:
        tape: The tape.
        inputs: Places of the given numbers.
        outputs: Places of the results.
    """

    tape: Tape
    inputs: Sequence[int]
    outputs: Sequence[int]

    def operations(self) -> int:
        """Count the operations that the results need."""
        names = [self.tape.operations[place].name for place in self.tape.needed(self.outputs)]
        return sum(name not in (INPUT, CONSTANT) for name in names)


def symbols(tape: Tape, count: int) -> list[Symbol]:
    """Append numbers that are given, under names of their own."""
    return [tape.input(f"x{len(tape.operations)}") for _ in range(count)]


def formula(tape: Tape, inputs: Iterable[Symbol], outputs: Iterable[Operand]) -> Formula:
    """Make a formula of what a tape has recorded.

    Raises:
        InputError: The outputs depend on other symbols.
    """
    made = Formula(tape, [symbol.place for symbol in inputs], [tape.place(output) for output in outputs])
    for place in tape.needed(made.outputs):
        if tape.operations[place].name == INPUT and place not in made.inputs:
            raise InputError(
                "it remembers something outside of its state, in self or elsewhere, which C would not have: make it a "
                "part of the state that step returns"
            )
    return made
