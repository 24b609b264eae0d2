"""What differs between two scenarios: in a summary, in words, and in a folder's name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import PurePath
from typing import Any

LONGEST_NAME = 60
"""Of a folder's name, what differs [characters]."""
SHOWN = 3
"""So many differences are shown in one line."""
NOT_DIFFERENCES = {"title", "seed", "observer.kind", "compare", "based_on", "versions"}
"""Fields that differ without being called a difference: they have a place of their own wherever a run is named."""


def differences(base: Mapping[str, Any], scenario: Mapping[str, Any]) -> dict[str, Any]:
    """What differs between two scenarios.

    Args:
        base: One of them, with every default written out.
        scenario: The other.

    Returns:
        Field, `section.field` -> its value in the other; None where it has no such field. The parameters of different
        observers are not compared.
    """
    left_out = NOT_DIFFERENCES | ({"observer"} if base["observer"]["kind"] != scenario["observer"]["kind"] else set())
    return {
        name: value
        for name, value in _differing(base, scenario)
        if name not in left_out and name.partition(".")[0] not in left_out
    }


def _differing(base: Any, other: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    below = f"{name}." if name else ""
    if isinstance(base, Mapping) and isinstance(other, Mapping):
        for key in dict.fromkeys([*other, *base]):
            yield from _differing(base.get(key), other.get(key), f"{below}{key}")
    elif _are_sections(base) and _are_sections(other) and len(base) == len(other):
        for i, (one, two) in enumerate(zip(base, other, strict=True)):
            yield from _differing(one, two, f"{below}{i}")
    elif base != other:
        yield name, other


def _are_sections(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(item, Mapping) for item in value)


def describe_differences(differing: Mapping[str, Any]) -> str:
    """The first few, after a comma, as `--set` takes them; nothing if nothing differs."""
    named = [f"{name}={_value(value)}" for name, value in zip(_short(differing), differing.values(), strict=True)]
    return "".join(f", {text}" for text in _first(named, SHOWN, " and {} more"))


def folder_suffix(differing: Mapping[str, Any]) -> str:
    """As the end of a folder's name: letters that every system takes, and not too many."""
    named = [
        re.sub(r"[^\w.=+-]+", "_", f"{name}={_value(value)}", flags=re.ASCII).strip("_")
        for name, value in zip(_short(differing), differing.values(), strict=True)
    ]
    count = len(named)
    while count and sum(len(text) + 1 for text in named[:count]) > LONGEST_NAME:
        count -= 1
    return "".join(f"-{text}" for text in _first(named, count, "and-{}-more"))


def safe_name(text: str) -> str:
    """A name of a user's as a part of a folder's: without what some system does not take, and not too long."""
    return re.sub(r'[\x00-\x1f\x7f/\\:*?"<>|\ud800-\udfff]', "_", text)[:LONGEST_NAME]


def _first(texts: list[str], count: int, rest: str) -> list[str]:
    """The first ones, and how many more there are."""
    more = len(texts) - count
    return texts if more <= 0 else [*texts[:count], rest.format(more).strip()]


def _short(names: Iterable[str]) -> list[str]:
    """Fields by their last name, or by as many as tell them apart from the other differences."""
    full = [name.split(".") for name in names]

    def short(parts: list[str]) -> str:
        for start in range(len(parts) - 1, 0, -1):
            end = parts[start:]
            if not end[0].isdecimal() and sum(other[-len(end) :] == end for other in full) == 1:
                return ".".join(end)
        return ".".join(parts)

    return [short(parts) for parts in full]


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None or value == []:
        return "none"
    if isinstance(value, list):
        return ",".join(_value(item) for item in value)
    if isinstance(value, Mapping):
        return ",".join(f"{name}={_value(item)}" for name, item in value.items())
    if isinstance(value, float):
        return f"{value:.6g}"
    return PurePath(str(value)).stem if str(value).endswith(".xml") else str(value)
