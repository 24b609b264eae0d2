"""What an observer's code is called in C, and what its numbers are."""

from __future__ import annotations

import inspect
import re
import textwrap
from typing import Any

from cmg_mj.export.tree import identifiers
from cmg_mj.observers.protocol import Observer
from cmg_mj.observers.registry import OBSERVERS

HEADERS = ("math", "stdio")
"""Whose files have these names in C already."""

WIDTH = 110
"""Of a comment's lines."""

MACROS = ("H", "ENCODERS", "ESTIMATES", "TEST_VECTOR_H", "TICKS")
"""What NAME_ is written before besides the parts of an estimate."""


def name_of(observer: Observer) -> str:
    """The name of an observer of `OBSERVERS`, or of a user's class: `WithBias` is with_bias.

    Args:
        observer: The observer.

    Returns:
        A name that files, types and functions in C begin with.
    """
    cls = type(observer)
    for name, path in OBSERVERS.items():
        if path == f"{cls.__module__}:{cls.__qualname__}":
            return name
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", cls.__name__)
    return identifiers([(spaced.strip("_").lower(),)], HEADERS)[0]


def files_of(name: str) -> list[str]:
    """The files of an export."""
    return [f"{name}.h", f"{name}.c", f"{name}_example.c", f"{name}_test_vector.h"]


def places_of(extra_signals: tuple[str, ...]) -> list[str]:
    """What the parts of an estimate are called in C, without the NAME_ before it."""
    return identifiers([(part.upper(),) for part in ("x1_rad", "x2_rad_s", "x3_rad", *extra_signals)], MACROS)


def settings_of(thing: Any, names: list[str] | None = None) -> list[str]:
    """What a value was made with, as in `tau = 0.02  Time constant [s]`, an entry each.

    Args:
        thing: A value whose docstring has a part "Attributes:".
        names: Of its constructor's parameters; all by default.

    Returns:
        Lines.
    """
    names = names or [*inspect.signature(type(thing)).parameters]
    values = {name: getattr(thing, name) for name in names if hasattr(thing, name)}
    words = _attributes(type(thing).__doc__ or "")
    width = max((len(f"{name} = {value!r}") for name, value in values.items()), default=0)
    lines = []
    for name, value in values.items():
        text = f"{f'{name} = {value!r}':<{width}}  {words.get(name, '')}"
        lines += textwrap.wrap(text, WIDTH, subsequent_indent=" " * (width + 2)) if width < WIDTH // 2 else [text]
    return lines


def _attributes(docstring: str) -> dict[str, str]:
    """Name -> words, of the part "Attributes:" of a docstring."""
    _, _, part = inspect.cleandoc(docstring).partition("Attributes:\n")
    block = re.split(r"\n(?=\S)", part)[0]
    entries = re.findall(r"^    (\w+)[^:\n]*: (.*(?:\n        .*)*)", block, re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}
