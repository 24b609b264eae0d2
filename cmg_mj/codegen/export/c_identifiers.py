"""Identifiers in C: reserved words, and the spelling of Python's names."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Collection, Sequence

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
