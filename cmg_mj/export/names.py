"""What an observer's code is called in C."""

from __future__ import annotations

import re

from cmg_mj.export.tree import identifiers
from cmg_mj.observers.protocol import Observer
from cmg_mj.observers.registry import OBSERVERS

HEADERS = ("math", "stdio")
"""Whose files have these names in C already."""

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
