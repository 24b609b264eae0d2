"""Converts an observer's state, a tree of containers, to a row of numbers and back."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from cmg_mj.core.arrays import Symbolic
from cmg_mj.core.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Number: TypeAlias = "Symbolic | float | np.bool_ | np.integer | np.floating"
Tree: TypeAlias = "Number | Constant | tuple[Tree, ...] | list[Tree] | dict[str, Tree] | np.ndarray | DataclassInstance"
Constant = str | type | None
Form: TypeAlias = "Tree | tuple[type, list[tuple[str, Form]]]"

NUMBERS = (Symbolic, bool, int, float, np.bool_, np.integer, np.floating)
CONSTANTS = (type(None), str, type)
"""Types of values that a state may hold besides numbers, if they stay the same."""
DEEPEST = 50
"""Largest depth of a state; a state that holds itself has no end."""


class NotExportable(InputError):
    """A state or an operation that no formula can express."""


class Leaf(NamedTuple):
    """A number in a state, and its path."""

    path: tuple[str, ...]
    value: Number


def numbers(tree: Tree, path: tuple[str, ...] = ()) -> Iterator[Leaf]:
    """Yield all numbers of a state, in order.

    Raises:
        NotExportable: The state holds other values, or goes too deep.
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
    elif not isinstance(tree, CONSTANTS):
        where = f" ({'.'.join(path)})" if path else ""
        raise NotExportable(
            f"its state holds a {type(tree).__name__}{where}, for which C has no "
            "place; use numbers, in tuples, lists, dicts, dataclasses or arrays"
        )


def form(tree: Tree) -> Form:
    """Return the part of a state that a step must not change: its containers, and the values that are no numbers."""
    parts = _parts(tree)
    if parts is None:
        return "number" if isinstance(tree, NUMBERS) else tree
    return type(tree), [(name, form(part)) for name, part in parts]


def rebuild(tree: Any, values: Iterator[Number]) -> Any:
    """Rebuild a state with other numbers."""
    parts = _parts(tree)
    if parts is None:
        return next(values) if isinstance(tree, NUMBERS) else tree
    rebuilt = [rebuild(part, values) for _, part in parts]
    names = [name for name, _ in parts]
    if isinstance(tree, np.ndarray):
        array = np.empty(tree.size, dtype=object)
        array[:] = rebuilt
        return array.reshape(tree.shape) if tree.ndim else rebuilt[0]
    if isinstance(tree, dict):
        return dict(zip(tree, rebuilt, strict=True))
    if dataclasses.is_dataclass(tree):
        other = copy.copy(tree)
        for name, part in zip(names, rebuilt, strict=True):
            object.__setattr__(other, name, part)
        return other
    if hasattr(tree, "_fields"):
        return type(tree)(**dict(zip(names, rebuilt, strict=True)))
    return type(tree)(rebuilt)


def _parts(tree: Tree) -> list[tuple[str, Tree]] | None:
    """Return names and values of a container's parts; None for a value that is no container."""
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
