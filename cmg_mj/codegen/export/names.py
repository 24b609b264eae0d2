"""Chooses the names of an observer's code in C."""

from __future__ import annotations

import re

from cmg_mj.codegen.export.c_identifiers import RESERVED, identifiers, spell_in_c
from cmg_mj.core.types import Observer
from cmg_mj.errors import InputError, shown
from cmg_mj.observers.registry import OBSERVERS

MACROS = ("H", "ENCODERS", "ESTIMATES", "TEST_VECTOR_H", "TICKS", "OK", "INPUT_NOT_FINITE", "RESULT_NOT_FINITE")
"""Words that follow NAME_ in macros, besides the parts of an estimate."""

LONGEST = 40
"""Longest name [characters]: C99 distinguishes names by their first 63 characters, suffixes included."""


def name_of(observer: Observer, user_name: str | None = None) -> str:
    """Name an observer of `OBSERVERS`, or a user's class: `WithBias` is with_bias, `Double` double_observer.

    Args:
        observer: The observer.
        user_name: A name that the user chose.

    Returns:
        The prefix of files, types and functions in C.

    Raises:
        InputError: The user's name is no name in C, or the class has a name that cannot be spelled in C.
    """
    if user_name is not None:
        if not re.fullmatch(rf"[A-Za-z][A-Za-z0-9_]{{0,{LONGEST - 1}}}", user_name, re.ASCII):
            raise InputError(
                f"--name {shown(user_name)}: must be a name in C: a letter, then letters without accents, digits and "
                f"_, at most {LONGEST} in all"
            )
        if {user_name, user_name.lower()} & RESERVED:
            raise InputError(
                f"--name {user_name}: is a word of C or of its library; take another, such as {user_name}_observer"
            )
        return user_name
    cls = type(observer)
    for name, path in OBSERVERS.items():
        if path == f"{cls.__module__}:{cls.__qualname__}":
            return name
    name = _class_in_c(cls.__name__)
    if name is None:
        raise InputError(
            f"the class's name {shown(cls.__name__)} makes none in C of 1 to {LONGEST} letters, digits and _: give one "
            "with --name"
        )
    return f"{name}_observer" if name in RESERVED else name


def _class_in_c(name: str) -> str | None:
    """Convert a class's name to C; None if that is impossible."""
    letters = spell_in_c(name)
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", letters or "")
    words = re.sub(r"[^a-z0-9]+", "_", spaced.lower()).strip("_")
    return words if re.fullmatch(rf"[a-z].{{0,{LONGEST - 1}}}", words) else None


def export_files(name: str) -> list[str]:
    """Name the files of an export."""
    return [f"{name}.h", f"{name}.c", f"{name}_example.c", f"{name}_test_vector.h"]


def estimate_places(extra_signals: tuple[str, ...]) -> list[str]:
    """Name the parts of an estimate in C, without the NAME_ before them."""
    return identifiers([(part.upper(),) for part in ("x1_rad", "x2_rad_s", "x3_rad", *extra_signals)], MACROS)
