"""A state as a tree of containers with numbers: its numbers in order, its form, and the same with other numbers."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.arrays import Symbolic
from cmg_mj.core.errors import InputError, shortened

NUMBERS = (Symbolic, bool, int, float, np.bool_, np.integer, np.floating)
FLOATS = (float, np.floating)
"""Numbers of a linear system: whole numbers and flags are no part of it."""
CONSTANTS = (type(None), str, type)
"""Types of values that a state may hold besides numbers, if they stay the same."""
MAX_DEPTH = 50
"""Largest depth of a state; a state that holds itself has no end."""


class Leaf(NamedTuple):
    """A number in a state, and its path."""

    path: tuple[str, ...]
    value: Any


def numbers(tree: Any, path: tuple[str, ...] = (), worlds: tuple[type, ...] = ()) -> Iterator[Leaf]:
    """Yield all numbers of a state, a tree of containers, in order.

    Args:
        tree: The state.
        path: Its own path.
        worlds: Types that are numbers too, one a world, such as an array.

    Raises:
        InputError: The state holds other values, or goes too deep.
    """
    if len(path) > MAX_DEPTH:
        raise InputError(
            f"its state goes deeper than {MAX_DEPTH} parts within parts, or holds itself: use a tuple of numbers"
        )
    parts = None if isinstance(tree, worlds) else _parts(tree)
    if parts is not None:
        for name, part in parts:
            yield from numbers(part, (*path, name), worlds)
    elif isinstance(tree, (*NUMBERS, *worlds)):
        yield Leaf(path, tree)
    elif not isinstance(tree, CONSTANTS):
        where = f" ({'.'.join(path)})" if path else ""
        raise InputError(
            f"its state holds a {shortened(type(tree).__name__)}{where}; use numbers, in tuples, lists, dicts, "
            "dataclasses or arrays"
        )


def form(tree: Any) -> Any:
    """Return the part of a state that a step must not change: its containers, and the values that are no numbers."""
    parts = _parts(tree)
    if parts is None:
        return "number" if isinstance(tree, NUMBERS) else tree
    return type(tree), [(name, form(part)) for name, part in parts]


def rebuild(tree: Any, values: Iterator[Any], kinds: tuple[type, ...] = NUMBERS) -> Any:
    """Rebuild a state with other numbers of these types, in the order of `numbers`."""
    parts = _parts(tree)
    if parts is None:
        return next(values) if isinstance(tree, kinds) else tree
    names, rebuilt = [name for name, _ in parts], [rebuild(part, values, kinds) for _, part in parts]
    if isinstance(tree, np.ndarray):
        kind = object if any(isinstance(part, Symbolic) for part in rebuilt) else tree.dtype
        return np.array(rebuilt, kind).reshape(tree.shape) if tree.ndim else rebuilt[0]
    if isinstance(tree, dict):
        return dict(zip(tree, rebuilt, strict=True))
    if dataclasses.is_dataclass(tree):
        made, attributes = copy.copy(tree), 0
    elif hasattr(tree, "_fields"):  # a Measurement has more than its fields
        made, attributes = tuple.__new__(type(tree), rebuilt[: len(tree)]), len(tree)
    else:
        return type(tree)(rebuilt)
    for name, part in list(zip(names, rebuilt, strict=True))[attributes:]:
        object.__setattr__(made, name, part)
    return made


def _parts(tree: Any) -> list[tuple[str, Any]] | None:
    """Return names and values of a container's parts; None for a value that is no container."""
    if hasattr(tree, "_fields"):
        return [*zip(tree._fields, tree, strict=True), *getattr(tree, "__dict__", {}).items()]
    if isinstance(tree, (tuple, list)):
        return [(str(i), part) for i, part in enumerate(tree)]
    if isinstance(tree, dict):
        return [(str(name), part) for name, part in tree.items()]
    if isinstance(tree, np.ndarray):
        return [("_".join(map(str, place)), tree[place]) for place in np.ndindex(*tree.shape)]
    if dataclasses.is_dataclass(tree) and not isinstance(tree, type):
        return [(field.name, getattr(tree, field.name)) for field in dataclasses.fields(tree)]
    return None
