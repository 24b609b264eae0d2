"""Fields of a section's class, and of the sections below it, by the marks on their types."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

Mark = TypeVar("Mark")


def marked_fields(section: type, mark: type[Mark]) -> dict[str, Mark]:
    """Find the fields that have a mark.

    Args:
        section: A class of pydantic's.
        mark: The mark's class.

    Returns:
        Field, `push.torque_n_m` -> its mark.
    """
    marks: dict[str, Mark] = {}
    for name, field in _fields(section).items():
        marks |= [(name, item) for item in field.metadata if isinstance(item, mark)]
        for part in _classes_in(field.annotation):
            marks |= {f"{name}.{below}": item for below, item in marked_fields(part, mark).items()}
    return marks


def marked_values(section: BaseModel, mark: type[Mark]) -> Iterator[tuple[str, float, Mark]]:
    """Go through the numbers of a section that have a mark.

    Args:
        section: The section, such as a scenario.
        mark: The mark's class.

    Yields:
        Field, `push.0.torque_n_m`, its value, its mark.
    """
    for name, field in _fields(type(section)).items():
        value = getattr(section, name)
        yield from ((name, value, item) for item in field.metadata if isinstance(item, mark))
        parts = {f"{name}.{i}": part for i, part in enumerate(value)} if isinstance(value, list) else {name: value}
        for at, part in parts.items():
            yield from ((f"{at}.{below}", number, item) for below, number, item in marked_values(part, mark))


def _fields(section: type) -> Mapping[str, FieldInfo]:
    return getattr(section, "__pydantic_fields__", {})


def _classes_in(annotation: Any) -> list[type]:
    """Return all classes that a type is put together from."""
    arguments = get_args(annotation)
    if arguments:
        return [part for argument in arguments for part in _classes_in(argument)]
    return [annotation] if isinstance(annotation, type) else []
