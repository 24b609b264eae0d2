"""An observer's state, whatever it is made of, as a row of numbers and back."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.codegen.export.source_location import NotExportable
from cmg_mj.elementwise import Symbolic

NUMBERS = (Symbolic, bool, int, float, np.bool_, np.integer, np.floating)
STAY = (type(None), str, type)
"""What a state may hold besides numbers, if it stays the same."""
DEEPEST = 50
"""Parts within parts; one that holds itself has no end."""


class Leaf(NamedTuple):
    """A number in a state, and the names that lead to it."""

    path: tuple[str, ...]
    value: Any


def numbers(tree: Any, path: tuple[str, ...] = ()) -> Iterator[Leaf]:
    """All numbers of a state, in order.

    Raises:
        NotExportable: It holds something else.
    """
    if len(path) > DEEPEST:
        raise NotExportable(
            f"its state goes deeper than {DEEPEST} parts within parts, or holds itself: use a tuple of numbers"
        )
    parts = _parts(tree)
    if parts is not None:
        for name, part in parts:
            yield from numbers(part, (*path, name))
    elif isinstance(tree, NUMBERS):
        yield Leaf(path, tree)
    elif not isinstance(tree, STAY):
        where = f" ({'.'.join(path)})" if path else ""
        raise NotExportable(
            f"its state holds a {type(tree).__name__}{where}, for which C has no "
            "place; use numbers, in tuples, lists, dicts, dataclasses or arrays"
        )


def form(tree: Any) -> Any:
    """What must be the same after a step: how the state is made, and what in it is no number."""
    parts = _parts(tree)
    if parts is None:
        return "number" if isinstance(tree, NUMBERS) else tree
    return type(tree), [(name, form(part)) for name, part in parts]


def rebuilt(tree: Any, given: Iterator[Any]) -> Any:
    """The same state with other numbers."""
    parts = _parts(tree)
    if parts is None:
        return next(given) if isinstance(tree, NUMBERS) else tree
    made = [rebuilt(part, given) for _, part in parts]
    names = [name for name, _ in parts]
    if isinstance(tree, np.ndarray):
        array = np.empty(tree.size, dtype=object)
        array[:] = made
        return array.reshape(tree.shape) if tree.ndim else made[0]
    if isinstance(tree, dict):
        return dict(zip(tree, made, strict=True))
    if dataclasses.is_dataclass(tree):
        other = copy.copy(tree)
        for name, part in zip(names, made, strict=True):
            object.__setattr__(other, name, part)
        return other
    if hasattr(tree, "_fields"):
        return type(tree)(**dict(zip(names, made, strict=True)))
    return type(tree)(made)


def _parts(tree: Any) -> list[tuple[str, Any]] | None:
    """Names and values of what a part of a state is made of; None for a part that is not made of others."""
    if isinstance(tree, tuple) and hasattr(tree, "_fields"):  # a Measurement has more than its fields
        return [*zip(tree._fields, tree, strict=True), *getattr(tree, "__dict__", {}).items()]  # type: ignore[attr-defined]
    if isinstance(tree, (tuple, list)):
        return [(str(i), part) for i, part in enumerate(tree)]
    if isinstance(tree, dict):
        return [(str(name), part) for name, part in tree.items()]
    if isinstance(tree, np.ndarray):
        return [("_".join(map(str, place)), tree[place]) for place in np.ndindex(*tree.shape)]
    if dataclasses.is_dataclass(tree) and not isinstance(tree, type):
        return [(field.name, getattr(tree, field.name)) for field in dataclasses.fields(tree)]
    return None
