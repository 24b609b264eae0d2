"""Makes pydantic's errors one clause for a user: field = value: what is allowed."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, get_args, get_origin

from cmg_mj.core.errors import TomlValue, nearest, shortened, shown
from cmg_mj.inputs.types import parts_of, pydantic_fields

SMALLEST, LARGEST = 1e-30, 1e30
"""Sizes of numbers. Products of a few numbers within them stay finite, and nothing a person can lift needs more."""


def out_of_size(fields: Mapping[str, TomlValue] | Sequence[TomlValue], at: str = "") -> Iterator[str]:
    """Find numbers so large or small that formulas overflow.

    Args:
        fields: The TOML file's content, or a part of it.
        at: The place of the part.

    Yields:
        Clauses for an error message.
    """
    for name, value in fields.items() if isinstance(fields, Mapping) else enumerate(fields):
        field = f"{at}.{name}".lstrip(".")
        if isinstance(value, (Mapping, list, tuple)):
            yield from out_of_size(value, field)
        elif not isinstance(value, (int, float)) or field == "seed" or not math.isfinite(value):
            continue
        elif abs(value) > LARGEST or 0.0 < abs(value) < SMALLEST:
            yield f"{field} = {value:g}: sizes are from {SMALLEST:g} to {LARGEST:g}, or 0"


def complaints(root: Any, errors: Iterable[Mapping[str, Any]], fields: Mapping[str, TomlValue]) -> list[str]:
    """Describe wrong fields: where, the value, what is allowed.

    Args:
        root: The class that was to be made.
        errors: Pydantic's errors.
        fields: What it was to be made from.

    Returns:
        A clause for each wrong field.
    """
    clauses: dict[str, str] = {}
    for detail in errors:
        kind = detail["type"]
        message = _WORDS_OF_TYPE.get(kind, str(detail["msg"]))
        for word, ours in _WORDS.items():
            message = message.replace(word, ours)
        # A union's members are parts of the location, with their type's name.
        location = [part for part in detail["loc"] if not (isinstance(part, str) and "[" in part)]
        while location and isinstance(location[-1], int) and not fields_of(_type_at(root, location)):
            location.pop()  # what is wrong with an element is wrong with its list
        where = shortened(".".join(map(str, location)))
        if kind in ("extra_forbidden", "unexpected_keyword_argument"):
            sections = {section: _section(annotation) for section, annotation in fields_of(root).items()}
            elsewhere = {f"{section}_{name}": f"{section}.{name}" for section in sections for name in sections[section]}
            name, known = str(location[-1]), _section(_type_at(root, location[:-1]))
            is_elsewhere = name in elsewhere and location[0] != "axes"
            guess = f"did you mean {elsewhere[name]!r}?" if is_elsewhere else nearest(name, known)
            clause = f"no such field; {guess}"
        elif kind in ("missing", "missing_argument") and isinstance(detail["loc"][-1], str):
            clause = "missing"
        elif kind == "value_error" or not location:
            clause = message
        else:
            value: Any = fields
            for part in location:
                value = value[part]
            guess, is_close, _ = nearest(str(value), re.findall(r"'(.+?)'", message)).partition("? ")
            clause = f"{message}; {guess}?" if kind == "literal_error" and is_close else message
            where += f" = {shown(value)}"
        clauses[where] = f"{clauses[where]}, or {clause.removeprefix('must be ')}" if where in clauses else clause
    return [f"{where}: {clause}" if where else clause for where, clause in clauses.items()]


_WORDS_OF_TYPE = {
    "missing": "must have more elements",  # of an element of a tuple
    "string_pattern_mismatch": "must have no control characters",
    "json_invalid": "not UTF-8 text, or tables in too many tables",
}
_WORDS = {
    "Value error, ": "",
    "Input should be": "must be",
    "Tuple should have": "must have",
    "String should": "must",
    " after validation": "",
    "a valid array": "a list",
    "an object": "a section",
    "a dictionary": "a section",
    "a valid ": "a ",
}
"""Pydantic's words -> words for the user of a TOML file."""


def _type_at(place: Any, location: Sequence[str | int]) -> Any:
    """Return the type of a field somewhere below a class."""
    for part in location:
        if isinstance(part, int):
            place = parts_of(place)[0] if get_origin(place) is list else float
        elif get_origin(place) is dict:  # [versions], [axes]
            place = get_args(place)[1]
        else:
            place = _section(place).get(part, str)
    return place


def _section(annotation: Any) -> dict[str, Any]:
    """Return the fields of the section that a type is, may be, or lists."""
    return next((fields for part in parts_of(annotation) if (fields := fields_of(part))), {})


def fields_of(place: Any) -> dict[str, Any]:
    """Return the fields of a section or observer class with their types and bounds; none for any other class."""
    return {
        name: Annotated[info.annotation, *info.metadata] if info.metadata else info.annotation
        for name, info in pydantic_fields(place).items()
    }
