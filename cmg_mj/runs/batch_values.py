"""Settings of many worlds as one: an array (n_worlds,) where the worlds differ."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from cmg_mj.core.errors import InputError

T = TypeVar("T")


def batch_values(values: Sequence[T]) -> T:
    """Stack the values of the worlds into one value.

    Args:
        values: A world each: numbers, or tuples or frozen dataclasses of such.

    Returns:
        The value itself where all are equal; where numbers differ, an array (n_worlds,). No field is checked anew.

    Raises:
        InputError: The worlds differ in something that is no number.
    """
    first: Any = values[0]
    if all(value is first or value == first for value in values):
        return first
    if dataclasses.is_dataclass(first):
        fields = {}
        for field in dataclasses.fields(first):
            try:
                fields[field.name] = batch_values([getattr(value, field.name) for value in values])
            except InputError as error:
                raise InputError(f"{field.name}: {error}") from error
        return _with_fields(type(first), fields)  # type: ignore[return-value]
    if isinstance(first, tuple) and {len(value) for value in values} == {len(first)}:  # type: ignore[arg-type]
        return tuple(map(batch_values, zip(*values, strict=True)))  # type: ignore[call-overload,return-value]
    if not all(type(value) in (int, float) for value in values):
        raise InputError("must have one value for all worlds of a batch")
    return np.array(values, dtype=float)  # type: ignore[return-value]


def split_values(value: T, worlds: int) -> list[T]:
    """Return the value of each world, from a value that is stacked or not."""
    first = value_of_world(value, 0)
    return [first] * worlds if first is value else [value_of_world(value, world) for world in range(worlds)]


def value_of_world(value: T, world: int) -> T:
    """Return a stacked value's value in one world.

    Args:
        value: What `batch_values` returned.
        world: The world's index.

    Returns:
        The value, on floats.
    """
    if isinstance(value, np.ndarray):
        return value[world].item()
    if isinstance(value, tuple):
        parts = tuple(value_of_world(part, world) for part in value)
        return value if all(a is b for a, b in zip(parts, value, strict=True)) else parts  # type: ignore[return-value]
    if not dataclasses.is_dataclass(value):
        return value
    parts = {field.name: value_of_world(getattr(value, field.name), world) for field in dataclasses.fields(value)}
    if all(part is getattr(value, name) for name, part in parts.items()):
        return value
    return _with_fields(type(value), parts)


def _with_fields(cls: type[T], fields: Mapping[str, Any]) -> T:
    """Make a frozen dataclass without checking its fields anew."""
    instance = object.__new__(cls)
    for name, value in fields.items():
        object.__setattr__(instance, name, value)
    return instance
