"""An observer's state, whatever it is made of, as a row of numbers and back."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.elementwise import Symbolic

KEYWORDS = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    """.split()  # noqa: SIM905
)
"""Words that name nothing in C."""


class Leaf(NamedTuple):
    """A part of a state that is not made of parts: a number, or something that stays as it is."""

    path: tuple[str, ...]
    value: Any

    @property
    def number(self) -> bool:
        """Whether it is a number; what is none must never change."""
        return isinstance(self.value, (Symbolic, bool, int, float, np.bool_, np.integer, np.floating))


def leaves(tree: Any, path: tuple[str, ...] = ()) -> Iterator[Leaf]:
    """All leaves of a state, in order."""
    parts = _parts(tree)
    if parts is None:
        yield Leaf(path, tree)
        return
    for name, part in parts:
        yield from leaves(part, (*path, name))


def form(tree: Any) -> Any:
    """What must stay the same from step to step: how the state is made, and what in it is no number."""
    parts = _parts(tree)
    if parts is None:
        return "number" if Leaf((), tree).number else tree
    return type(tree), [(name, form(part)) for name, part in parts]


def rebuilt(tree: Any, numbers: Iterator[Any]) -> Any:
    """The same state with other numbers."""
    parts = _parts(tree)
    if parts is None:
        return next(numbers) if Leaf((), tree).number else tree
    made = {name: rebuilt(part, numbers) for name, part in parts}
    if isinstance(tree, np.ndarray):
        array = np.empty(tree.size, dtype=object)
        array[:] = list(made.values())
        return array.reshape(tree.shape)
    if isinstance(tree, dict):
        return dict(zip(tree, made.values(), strict=True))
    if isinstance(tree, (tuple, list)) and not hasattr(tree, "_fields"):
        return type(tree)(made.values())
    return type(tree)(**made)


def _parts(tree: Any) -> list[tuple[str, Any]] | None:
    """Names and values of what a part of a state is made of; None for a leaf."""
    if isinstance(tree, tuple) and hasattr(tree, "_fields"):  # a Measurement has more than these
        return [*zip(tree._fields, tree, strict=True), *getattr(tree, "__dict__", {}).items()]  # type: ignore[attr-defined]
    if isinstance(tree, (tuple, list)):
        return [(str(i), part) for i, part in enumerate(tree)]
    if isinstance(tree, dict):
        return [(str(name), part) for name, part in tree.items()]
    if isinstance(tree, np.ndarray) and tree.ndim:
        return [("_".join(map(str, place)), tree[place]) for place in np.ndindex(*tree.shape)]
    if isinstance(tree, np.ndarray):
        return None if not tree.shape and Leaf((), tree[()]).number else []
    if dataclasses.is_dataclass(tree) and not isinstance(tree, type):
        return [(field.name, getattr(tree, field.name)) for field in dataclasses.fields(tree)]
    return None


def identifiers(paths: list[tuple[str, ...]]) -> list[str]:
    """Names in C, one a path, each once."""
    names: list[str] = []
    for path in paths:
        name = re.sub(r"[^A-Za-z0-9_]", "_", "_".join(path)) or "value"
        name = f"s{name}" if not name[0].isalpha() else name
        while name in KEYWORDS or name in names:
            name += "_"
        names.append(name)
    return names
