"""The varied fields of a sweep: `--vary FIELD=...`, a list or a range."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias, TypeGuard, runtime_checkable

import numpy as np

from cmg_mj.errors import InputError, shown
from cmg_mj.inputs.messages import LARGEST

FieldValue: TypeAlias = "float | str | Sequence[FieldValue] | Mapping[str, FieldValue]"
"""A value of a scenario's field, as TOML has it."""


@runtime_checkable
class Array(Protocol):
    """Numbers of numpy, pandas or the like."""

    def tolist(self) -> FieldValue:
        """Make plain numbers."""
        ...


Variation: TypeAlias = "FieldValue | Array"
"""Values of a field: a list of them, a single one, or text as `--vary` takes it."""

MOST_VALUES = 10_000
"""Values of one field."""
LOG = "log:"
TOGETHER = "+"
"""Between fields that take the same values."""
DIGITS = 12
"""Significant digits of a range's values: 0.3 is to be 0.3, in the table too."""


@dataclass(frozen=True)
class VariedField:
    """One varied field, or several that take the same values together.

    Attributes:
        field: The field, as with `--set`; of several the first, which names the axis in tables and pictures.
        values: The values of a list or of a range with a count; none for a range of which any value may be sampled.
        low: Lower end of a range to be sampled.
        high: Upper end of a range to be sampled.
        log: Whether the range is sampled evenly in its logarithm.
        also: Fields that take the same value at every point.
    """

    field: str
    values: tuple[FieldValue, ...] = ()
    low: float = math.nan
    high: float = math.nan
    log: bool = False
    also: tuple[str, ...] = ()

    @property
    def fields(self) -> tuple[str, ...]:
        """All fields that take the value."""
        return (self.field, *self.also)

    @property
    def option(self) -> str:
        """The fields as `--vary` takes them."""
        return TOGETHER.join(self.fields)

    @property
    def is_range(self) -> bool:
        """Return whether the values are a range to be sampled."""
        return not self.values

    def at(self, shares: np.ndarray) -> list[FieldValue]:
        """Choose values at shares of the range between 0 and 1, (n,); of a list each value has an equal part."""
        if not self.is_range:
            return [self.values[min(int(share * len(self.values)), len(self.values) - 1)] for share in shares]
        if self.log:
            values = np.exp(math.log(self.low) + shares * (math.log(self.high) - math.log(self.low)))
        else:
            values = self.low + shares * (self.high - self.low)
        return [float(f"{value:.{DIGITS}g}") for value in values]

    def as_field(self) -> FieldValue:
        """Write the values as a study file has them: a list, or `low:high`."""
        return list(self.values) if self.values else f"{LOG if self.log else ''}{self.low!r}:{self.high!r}"


def parse_axis(field: str, variation: Variation, where: str) -> VariedField:
    """Read the values of a varied field.

    Args:
        field: The field; several that take the same values with `+` between.
        variation: A list of values, or a single one; or text: values with commas between, `first:last:count` for as
            many evenly spaced, `low:high` for a range to be sampled, each also with `log:` before it.
        where: The setting's name in an error.

    Returns:
        The axis.

    Raises:
        InputError: The field or its values are not written so.
    """
    field, *also = (part.strip() for part in field.split(TOGETHER))
    if not field or "" in also:
        raise InputError(f"{where}: write FIELD=VALUES, for example plant.equilibrium_bias_deg=-1.5:1.5:13")
    if isinstance(variation, str) and ":" in variation and not variation.lstrip().startswith(("[", '"')):
        return replace(_parse_range(field, variation.strip(), where), also=tuple(also))
    values = _parse_list(variation, where) if isinstance(variation, str) else _as_list(variation, where)
    if not values:
        raise InputError(f"{where}: no values; write FIELD=VALUES, such as plant.equilibrium_bias_deg=0,0.5")
    if len(values) > MOST_VALUES:
        raise InputError(f"{where}: {len(values)} values; at most {MOST_VALUES}")
    twice = next((value for i, value in enumerate(values) if value in values[:i]), None)
    if twice is not None:
        raise InputError(f"{where}: {twice} is there twice")
    return VariedField(field, tuple(values), also=tuple(also))


def _parse_range(field: str, text: str, where: str) -> VariedField:
    log = text.startswith(LOG)
    parts = text.removeprefix(LOG).split(":")
    how = "write first:last:count, or low:high for --sample and --sobol, with log: before it for a logarithmic one"
    try:
        low, high = (float(part) for part in parts[:2])
        count = int(parts[2]) if len(parts) == 3 else None
    except ValueError:
        raise InputError(f"{where}: {text!r} is no range; {how}") from None
    if len(parts) > 3:
        raise InputError(f"{where}: {text!r} is no range; {how}")
    if not (math.isfinite(low) and math.isfinite(high)) or low == high:
        raise InputError(f"{where}: an empty range; its ends must be two different numbers")
    if not math.isfinite(high - low):
        raise InputError(f"{where}: {low:g} to {high:g} is wider than numbers reach; sizes are at most {LARGEST:g}")
    if log and not (low > 0.0 and high > 0.0):
        raise InputError(f"{where}: a logarithmic range needs ends above 0")
    if count is None:
        if low > high:
            raise InputError(f"{where}: an empty range: {low:g} is above {high:g}")
        return VariedField(field, (), low, high, log)
    if not 2 <= count <= MOST_VALUES:
        raise InputError(f"{where}: {count} values; a range has at least 2, at most {MOST_VALUES}")
    shares = np.linspace(0.0, 1.0, count)
    return VariedField(field, tuple(VariedField(field, (), low, high, log).at(shares)))


def _as_list(variation: Variation, where: str) -> list[FieldValue]:
    """Make values that are no text into a list, with numpy's numbers as Python's."""
    values = variation.tolist() if isinstance(variation, Array) else variation
    if isinstance(values, (bool, int, float)):
        return [values]
    if isinstance(values, Mapping) or not isinstance(values, Iterable):
        raise InputError(f"{where}: {shown(values)}: must be a list of values, or text such as '-1:1:5'")
    return [value.tolist() if isinstance(value, Array) else value for value in values]


def _parse_list(text: str, where: str) -> list[FieldValue]:
    """Read values with commas between; a bare word is a string, as with `--set`."""
    try:
        return tomllib.loads(f"values = [{text}]")["values"]
    except (ValueError, RecursionError):
        words = [word.strip() for word in text.split(",")]
        if "" in words or any(mark in text for mark in "[]{}\"'="):
            raise InputError(f"{where}: {text!r} is no list; write values with commas between") from None
        return [_word(word) for word in words]


def _word(word: str) -> FieldValue:
    try:
        return tomllib.loads(f"value = {word}")["value"]
    except ValueError:
        return word


def is_number(value: FieldValue) -> TypeGuard[float]:
    """Tell a number from a truth value, a text and a list."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)
