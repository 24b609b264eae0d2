"""Refuses what no field of a scenario takes: text that is not UTF-8, sizes that overflow, sections without end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from cmg_mj.errors import LONGEST_SHOWN, TomlValue, shown

SMALLEST, LARGEST = 1e-30, 1e30
"""Sizes of numbers. Products of a few numbers within them stay finite, and nothing a person can lift needs more."""
MOST_BITS = 128
"""Bits of a whole number; seeds that NumPy makes have so many."""
DEEPEST = 12
"""Deepest nesting of sections and lists; the scenario's own are four deep."""


def is_text(text: str) -> bool:
    """Say whether a string is text, and not bytes that Python could not read as UTF-8."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def path_of(parts: Iterable[str | int]) -> str:
    """Write where a field is, `plant.model`, shortened."""
    path = ".".join(str(part) for part in parts)
    return path if len(path) <= LONGEST_SHOWN else f"{path[:LONGEST_SHOWN]}..."


def unreadable(fields: Mapping[str, TomlValue]) -> Iterator[str]:
    """Find what cannot be read as a scenario, whatever the fields are called.

    Args:
        fields: The TOML file's content.

    Yields:
        Clauses for an error message.
    """
    for path, value in _walk(fields):
        where = path_of(path)
        if len(path) > DEEPEST:
            yield f"{where}: more than {DEEPEST} sections and lists in one another"
        elif not is_text("".join(map(str, path))):
            yield f"{where!r}: not UTF-8 text"
        elif isinstance(value, str) and not is_text(value):
            yield f"{where} = {shown(value)}: not UTF-8 text"
        elif isinstance(value, int) and value.bit_length() > MOST_BITS:
            yield f"{where}: a whole number of {value.bit_length()} bits; at most {MOST_BITS} are allowed"


def out_of_size(fields: Mapping[str, TomlValue]) -> Iterator[str]:
    """Find numbers so large or small that formulas overflow.

    Args:
        fields: The TOML file's content, which is readable.

    Yields:
        Clauses for an error message.
    """
    for path, value in _walk(fields):
        if not isinstance(value, (int, float)) or path == ("seed",) or not math.isfinite(value):
            continue
        if abs(value) > LARGEST or 0.0 < abs(value) < SMALLEST:
            yield f"{path_of(path)} = {value:g}: sizes are from {SMALLEST:g} to {LARGEST:g}, or 0"


def _walk(fields: Mapping[str, TomlValue]) -> Iterator[tuple[tuple[str | int, ...], TomlValue]]:
    """Visit every value with its place, and what lies too deep."""
    waiting: list[tuple[tuple[str | int, ...], TomlValue]] = [((), fields)]
    while waiting:  # no recursion: it would end before the sections do
        path, value = waiting.pop()
        if tolist := getattr(value, "tolist", None):
            value = tolist()
        yield path, value
        if isinstance(value, (Mapping, list, tuple)) and len(path) <= DEEPEST:
            inside = value.items() if isinstance(value, Mapping) else enumerate(value)
            waiting += [((*path, name), item) for name, item in reversed(list(inside))]
