"""Words in C: which are taken, and how a name of Python's is spelled there."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Collection, Sequence

TAKEN = frozenset(
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

SPELLED = {"ß": "ss", "ẞ": "SS"}
"""What Unicode does not take apart, and its names do not say."""


def spelled(text: str) -> str | None:
    """A name of Python's in letters of C: `Größe` is Grosse, `ω_max` is omega_max.

    Args:
        text: The name.

    Returns:
        The same where it is C already; None if it has a letter that is neither Latin nor Greek.
    """
    parts = [_letter(letter) for letter in unicodedata.normalize("NFKD", text)]
    return None if None in parts else "".join(part for part in parts if part)


def _letter(letter: str) -> str | None:
    if letter.isascii():
        return letter
    if unicodedata.combining(letter):
        return ""
    if letter in SPELLED:
        return SPELLED[letter]
    found = re.fullmatch(
        r"(?:GREEK|LATIN) (CAPITAL|SMALL) (?:LETTER|LIGATURE) (?:\w+ )*?(\w+)(?: WITH .*)?",
        unicodedata.name(letter, ""),
    )
    if found is None:
        return None
    size, name = found.groups()
    return name.lower() if size == "SMALL" else name.capitalize()


def identifiers(paths: Sequence[tuple[str, ...]], taken: Collection[str] = ()) -> list[str]:
    """Names in C, one a path, each once and none that is taken."""
    names: list[str] = []
    for path in paths:
        parts = [spelled(part) or "" for part in path]
        name = re.sub(r"[^A-Za-z0-9_]", "_", "_".join(part for part in parts if part)) or "value"
        name = name if name[0].isalpha() else f"s{name}"
        name += "_" if name in TAKEN or name in taken else ""
        several = itertools.chain([name], (f"{name}_{number}" for number in itertools.count(2)))
        names.append(next(one for one in several if one not in names))
    return names
