"""The differences between two scenarios: in words, and in a folder's name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import PurePath

from cmg_mj.core.errors import TomlValue

LONGEST_NAME = 60
"""Longest text of the differences in a folder's name [characters]."""
SHOWN = 3
"""Most differences in one line."""


def describe_differences(differing: Mapping[str, TomlValue | None]) -> str:
    """Write the first few after a comma, as `--set` takes them; nothing if nothing differs."""
    assignments = [f"{name}={_value(value)}" for name, value in zip(_short(differing), differing.values(), strict=True)]
    return "".join(f", {text}" for text in _first(assignments, SHOWN, " and {} more"))


def folder_suffix(differing: Mapping[str, TomlValue | None]) -> str:
    """Make the end of a folder's name: letters that every system takes, and not too many."""
    assignments = [
        re.sub(r"[^\w.=+-]+", "_", f"{name}={_value(value)}", flags=re.ASCII).strip("_")
        for name, value in zip(_short(differing), differing.values(), strict=True)
    ]
    count = len(assignments)
    while count and sum(len(text) + 1 for text in assignments[:count]) > LONGEST_NAME:
        count -= 1
    return "".join(f"-{text}" for text in _first(assignments, count, "and-{}-more"))


def safe_name(text: str) -> str:
    """Make a user's name a part of a folder's: without letters that some system refuses, and not too long."""
    return re.sub(r'[\x00-\x1f\x7f/\\:*?"<>|\ud800-\udfff]', "_", text)[:LONGEST_NAME]


def _first(texts: list[str], count: int, rest: str) -> list[str]:
    """Return the first ones, and how many more there are."""
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


def _value(value: TomlValue | None) -> str:
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
