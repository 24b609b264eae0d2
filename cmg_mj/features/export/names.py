"""Chooses the names of an observer's code in C."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Collection, Sequence

from cmg_mj.core.errors import InputError, shown
from cmg_mj.core.types import STATE_SIGNALS, Observer
from cmg_mj.observers import OBSERVERS

RESERVED = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while

    alignas alignof bool constexpr false nullptr static_assert thread_local true typeof typeof_unqual

    and and_eq asm bitand bitor catch char16_t char32_t char8_t class co_await co_return co_yield compl concept
    const_cast consteval constinit decltype delete dynamic_cast explicit export friend mutable namespace new noexcept
    not not_eq operator or or_eq private protected public reinterpret_cast requires static_cast template this throw
    try typeid typename using virtual wchar_t xor xor_eq

    assert complex errno imaginary linux noreturn offsetof setjmp stderr stdin stdout unix
    EOF HUGE_VAL HUGE_VALF HUGE_VALL I INFINITY M_PI M_PI_2 M_PI_4 NAN NULL

    abort abs atexit calloc ceil cos div erf exit exp fabs floor fma fmax fmin fmod free frexp gamma hypot isfinite
    isinf isnan labs ldexp log main malloc max memcpy memset min modf pow printf puts rand realloc remainder round
    signbit sin sqrt srand tan time trunc

    ctype fenv inttypes iso646 limits locale math pthread sched signal stdalign stdarg stdatomic stdbool stdckdint
    stddef stdint stdio stdlib stdnoreturn string strings tgmath threads uchar unistd wchar wctype
    """.split()  # noqa: SIM905
)
"""Words of C, those of C23 and C++ that C99 has not (C++ may read the header), macros, functions of the library, its
headers (whose files have these names already)."""

SPELLINGS = {"ß": "ss", "ẞ": "SS"}
"""Spelling of letters that Unicode neither decomposes nor names usefully."""


def spell_in_c(text: str) -> str | None:
    """Spell a name of Python's in letters of C: `Größe` is Grosse, `ω_max` is omega_max.

    Args:
        text: The name.

    Returns:
        The name in letters of C; None if one of its letters is neither Latin nor Greek.
    """
    parts = [_letter(letter) for letter in unicodedata.normalize("NFKD", text)]
    return None if None in parts else "".join(part for part in parts if part)


def _letter(letter: str) -> str | None:
    if letter.isascii():
        return letter
    if unicodedata.combining(letter):
        return ""
    if letter in SPELLINGS:
        return SPELLINGS[letter]
    match = re.fullmatch(
        r"(?:GREEK|LATIN) (CAPITAL|SMALL) (?:LETTER|LIGATURE) (?:\w+ )*?(\w+)(?: WITH .*)?",
        unicodedata.name(letter, ""),
    )
    if match is None:
        return None
    size, name = match.groups()
    return name.lower() if size == "SMALL" else name.capitalize()


def identifiers(paths: Sequence[tuple[str, ...]], reserved: Collection[str] = ()) -> list[str]:
    """Make a unique identifier for each path, none of them reserved."""
    names: list[str] = []
    for path in paths:
        parts = [spell_in_c(part) or "" for part in path]
        name = re.sub(r"[^A-Za-z0-9_]", "_", "_".join(part for part in parts if part)) or "value"
        name = name if name[0].isalpha() else f"s{name}"
        name += "_" if name in RESERVED or name in reserved else ""
        candidates = itertools.chain([name], (f"{name}_{number}" for number in itertools.count(2)))
        names.append(next(candidate for candidate in candidates if candidate not in names))
    return names


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
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", spell_in_c(cls.__name__) or "")
    name = re.sub(r"[^a-z0-9]+", "_", spaced.lower()).strip("_")
    if not re.fullmatch(rf"[a-z].{{0,{LONGEST - 1}}}", name):
        raise InputError(
            f"the class's name {shown(cls.__name__)} makes none in C of 1 to {LONGEST} letters, digits and _: "
            "give one with --name"
        )
    return f"{name}_observer" if name in RESERVED else name


def estimate_places(extra_signals: tuple[str, ...]) -> list[str]:
    """Name the parts of an estimate in C, without the NAME_ before them."""
    return identifiers([(part.upper(),) for part in (*STATE_SIGNALS, *extra_signals)], MACROS)
