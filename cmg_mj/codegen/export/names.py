"""What an observer's code is called in C."""

from __future__ import annotations

import re

from cmg_mj.codegen.export.c_identifiers import TAKEN, identifiers, spelled
from cmg_mj.errors import InputError, shown
from cmg_mj.observers.protocol import Observer
from cmg_mj.observers.registry import OBSERVERS

MACROS = ("H", "ENCODERS", "ESTIMATES", "TEST_VECTOR_H", "TICKS")
"""What NAME_ is written before besides the parts of an estimate."""

LONGEST = 40
"""Characters of a name: C99 tells names apart by their first 63, and something comes behind this one."""


def name_of(observer: Observer, asked: str | None = None) -> str:
    """The name of an observer of `OBSERVERS`, or of a user's class: `WithBias` is with_bias, `Double` double_observer.

    Args:
        observer: The observer.
        asked: What the user wants it to be called.

    Returns:
        A name that files, types and functions in C begin with.

    Raises:
        InputError: What is asked for is none in C, or the class has a name that cannot be spelled there.
    """
    if asked is not None:
        if not re.fullmatch(rf"[A-Za-z][A-Za-z0-9_]{{0,{LONGEST - 1}}}", asked, re.ASCII):
            raise InputError(
                f"--name {shown(asked)}: must be a name in C: a letter, then letters without accents, digits and _, at "
                f"most {LONGEST} in all"
            )
        if {asked, asked.lower()} & TAKEN:
            raise InputError(
                f"--name {asked}: is a word of C or of its library; take another, such as {asked}_observer"
            )
        return asked
    cls = type(observer)
    for name, path in OBSERVERS.items():
        if path == f"{cls.__module__}:{cls.__qualname__}":
            return name
    name = _of_a_class(cls.__name__)
    if name is None:
        raise InputError(
            f"the class's name {shown(cls.__name__)} makes none in C of 1 to {LONGEST} letters, digits and _: give one "
            "with --name"
        )
    return f"{name}_observer" if name in TAKEN else name


def _of_a_class(name: str) -> str | None:
    """A class's name as C writes one, if there is any."""
    letters = spelled(name)
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", letters or "")
    words = re.sub(r"[^a-z0-9]+", "_", spaced.lower()).strip("_")
    return words if re.fullmatch(rf"[a-z].{{0,{LONGEST - 1}}}", words) else None


def files_of(name: str) -> list[str]:
    """The files of an export."""
    return [f"{name}.h", f"{name}.c", f"{name}_example.c", f"{name}_test_vector.h"]


def places_of(extra_signals: tuple[str, ...]) -> list[str]:
    """What the parts of an estimate are called in C, without the NAME_ before it."""
    return identifiers([(part.upper(),) for part in ("x1_rad", "x2_rad_s", "x3_rad", *extra_signals)], MACROS)
