"""Words pydantic's errors for users: what is wrong, where, and what is allowed."""

from __future__ import annotations

import types
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from cmg_mj.errors import TomlValue, nearest, shown
from cmg_mj.inputs.sanity import path_of


def expected(annotation: Any) -> str:
    """Say what a field takes, from its type: `a number greater than 0`.

    Args:
        annotation: The field's type, with its bounds.

    Returns:
        A noun phrase.
    """
    base, bounds = _unwrapped(annotation)
    origin, arguments = get_origin(base), get_args(base)
    if origin in (Union, types.UnionType):
        return " or ".join(expected(part) for part in arguments if part is not types.NoneType)
    if origin is Literal:
        choices = ", ".join(repr(choice) for choice in arguments)
        return choices if len(arguments) == 1 else f"one of {choices}"
    if origin is list or arguments[1:] == (...,):
        return f"a list of {_plural(expected(arguments[0]))}"
    if origin is tuple:
        return f"a list of {len(arguments)} {_plural(expected(arguments[0]))}"
    if base is bool:
        return "true or false"
    if base is str:
        return " ".join(["text in quotes", *_text_bounds(bounds)])
    if base in (int, float):
        kind = "a whole number" if base is int else "a number"
        return " ".join([kind, " and ".join(_bounds(bounds))]).strip()
    return "a section"


def _unwrapped(annotation: Any) -> tuple[Any, list[Any]]:
    """Return a type without `Annotated`, and all bounds on it."""
    bounds: list[Any] = []
    while get_origin(annotation) is Annotated:
        annotation, *extra = get_args(annotation)
        for item in extra:
            bounds += getattr(item, "metadata", None) or [item]  # pydantic's FieldInfo keeps the bounds in a list
    return annotation, bounds


def _bounds(metadata: Iterable[Any]) -> list[str]:
    names = (("gt", "greater than"), ("ge", "greater than or equal to"), ("lt", "less than"), ("le", "at most"))
    return [
        f"{words} {getattr(bound, name):g}"
        for bound in metadata
        for name, words in names
        if getattr(bound, name, None) is not None
    ]


def _text_bounds(metadata: Iterable[Any]) -> list[str]:
    longest = [f"of at most {bound.max_length} characters" for bound in metadata if hasattr(bound, "max_length")]
    return [*longest, *(["without control characters"] if any(hasattr(bound, "pattern") for bound in metadata) else [])]


def _plural(phrase: str) -> str:
    """Turn `a number greater than 0` into `numbers greater than 0`."""
    for one, many in (
        ("a whole number", "whole numbers"),
        ("a number", "numbers"),
        ("a list", "lists"),
        ("a section", "sections"),
        ("text in quotes", "names in quotes"),
    ):
        if phrase.startswith(one):
            return many + phrase[len(one) :]
    return phrase


def complaint(root: Any, detail: Mapping[str, Any], fields: Mapping[str, TomlValue]) -> str:
    """Describe one wrong field: where, its value, what is allowed.

    Args:
        root: The class that was to be made.
        detail: One of pydantic's errors.
        fields: What it was to be made from.

    Returns:
        A clause for an error message.
    """
    location = [
        part for part in detail["loc"] if not str(part).startswith(("list[", "tuple[", "literal["))
    ]  # a union's members
    kind = detail["type"]
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        where = path_of(location)
        return f"{where}: no such field; {nearest(str(location[-1]), _section(_type_at(root, location[:-1])))}"
    missing = kind in ("missing", "missing_argument")
    while location and isinstance(location[-1], int) and not fields_of(_type_at(root, location)):
        location.pop()  # what is wrong with an element is wrong with its list
        missing = False
    where = path_of(location)
    annotation = _type_at(root, location)
    if missing:
        return f"{where}: missing; must be {expected(annotation)}"
    if kind == "value_error":
        message = detail["msg"].removeprefix("Value error, ")
        return f"{where}: {message}" if where else message
    value: Any = fields
    for part in location:
        value = value[part]
    if _section(annotation):
        if get_origin(annotation) is list:
            return f"{where}: must be a list of sections, each written under [[{where}]]"
        header = f"[{where}]" if isinstance(location[-1], str) else f"[[{location[0]}]]"
        return f"{where} = {shown(value)}: must be a section, written under {header}"
    return not_allowed(where, value, annotation, finite=kind != "finite_number")


def not_allowed(where: str, value: TomlValue, annotation: Any, *, finite: bool = True) -> str:
    """Say that a value is not what a field takes.

    Args:
        where: The field.
        value: The value.
        annotation: The field's type, with its bounds.
        finite: Whether the value is a finite number, or none at all.

    Returns:
        A clause for an error message.
    """
    what = expected(annotation)
    if not finite:
        what = what.replace("number", "finite number", 1)
    choices = [choice for choice in _types_in(annotation) if isinstance(choice, str)]
    if isinstance(value, str) and len(choices) > 1:
        typo = nearest(value, choices).partition("? ")
        what += f"; {typo[0]}?" if typo[1] else ""
    return f"{where} = {shown(value)}: must be {what}"


def _type_at(place: Any, location: Sequence[str | int]) -> Any:
    """Return the type, bounds included, of a field somewhere below a class."""
    for part in location:
        if isinstance(part, int):
            place = _types_in(place)[0] if get_origin(place) is list else float
        elif get_origin(place) is dict:  # [versions], [axes]
            place = get_args(place)[1]
        else:
            place = _section(place).get(part, str)
    return place


def _section(annotation: Any) -> dict[str, Any]:
    """Return the fields of the section that a type is, may be, or lists."""
    return next((fields for part in _types_in(annotation) if (fields := fields_of(part))), {})


def fields_of(place: Any) -> dict[str, Any]:
    """Return the fields of a section or observer class with their types and bounds; none for any other class."""
    infos = getattr(place, "__pydantic_fields__", {}) if isinstance(place, type) else {}
    return {
        name: Annotated[info.annotation, *info.metadata] if info.metadata else info.annotation
        for name, info in infos.items()
    }


def _types_in(annotation: Any) -> list[Any]:
    """List the parts of a type: classes, and the choices of a Literal."""
    if get_origin(annotation) is Annotated:
        return _types_in(get_args(annotation)[0])
    arguments = get_args(annotation)
    return [annotation] if not arguments else [t for argument in arguments for t in _types_in(argument)]
