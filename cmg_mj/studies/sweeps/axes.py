"""What a sweep varies: `--vary FIELD=...`, a list or a range."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cmg_mj.errors import InputError, shown

MOST_VALUES = 10_000
"""Of one field."""
LOG = "log:"
TOGETHER = "+"
"""Between fields that take the same values."""
DIGITS = 12
"""Of a range's values: 0.3 is to be 0.3, in the table too."""


@dataclass(frozen=True)
class VariedField:
    """One varied field, or several that take the same values together.

    Attributes:
        field: As with `--set`; of several the first, which names the axis in tables and pictures.
        values: What it takes, in a list or a range with a count; none for a range of which any value may be sampled.
        low: The range's lower end, for one to be sampled.
        high: Its upper end.
        log: Whether it is sampled evenly in its logarithm.
        also: Fields that take the same value at every point.
    """

    field: str
    values: tuple[Any, ...] = ()
    low: float = math.nan
    high: float = math.nan
    log: bool = False
    also: tuple[str, ...] = ()

    @property
    def fields(self) -> tuple[str, ...]:
        """All that it sets."""
        return (self.field, *self.also)

    @property
    def written(self) -> str:
        """Its fields as `--vary` takes them."""
        return TOGETHER.join(self.fields)

    @property
    def is_range(self) -> bool:
        """Whether it is a range to be sampled."""
        return not self.values

    def at(self, shares: np.ndarray) -> list[Any]:
        """Its values at shares of the range between 0 and 1, (n,); of a list each has an equal part of them."""
        if not self.is_range:
            return [self.values[min(int(share * len(self.values)), len(self.values) - 1)] for share in shares]
        if self.log:
            found = np.exp(math.log(self.low) + shares * (math.log(self.high) - math.log(self.low)))
        else:
            found = self.low + shares * (self.high - self.low)
        return [_rounded(value) for value in found]

    def said(self) -> Any:
        """As a study file says it: a list of values, or `low:high`."""
        return list(self.values) if self.values else f"{LOG if self.log else ''}{self.low!r}:{self.high!r}"


def parse_axis(field: str, said: Any, where: str) -> VariedField:
    """Read what a field is to take.

    Args:
        field: The field; several that take the same values with `+` between.
        said: A list of values, or a single one; or text: values with commas between, `first:last:count` for as many
            evenly spaced, `low:high` for a range to be sampled, each also with `log:` before it.
        where: What to call it in an error.

    Returns:
        The axis.

    Raises:
        InputError: It is not written so.
    """
    field, *also = (part.strip() for part in field.split(TOGETHER))
    if not field or "" in also:
        raise InputError(f"{where}: write FIELD=VALUES, for example plant.equilibrium_bias_deg=-1.5:1.5:13")
    if isinstance(said, str) and ":" in said and not said.lstrip().startswith(("[", '"')):
        return replace(_range(field, said, where), also=tuple(also))
    values = _listed(said, where) if isinstance(said, str) else _given(said, where)
    if not values:
        raise InputError(f"{where}: no values; write FIELD=VALUES, such as plant.equilibrium_bias_deg=0,0.5")
    if len(values) > MOST_VALUES:
        raise InputError(f"{where}: {len(values)} values; at most {MOST_VALUES}")
    twice = next((value for i, value in enumerate(values) if value in values[:i]), None)
    if twice is not None:
        raise InputError(f"{where}: {twice} is there twice")
    return VariedField(field, tuple(values), also=tuple(also))


def _range(field: str, said: str, where: str) -> VariedField:
    log = said.strip().startswith(LOG)
    parts = said.strip().removeprefix(LOG).split(":")
    how = "write first:last:count, or low:high for --sample and --sobol, with log: before it for a logarithmic one"
    try:
        low, high = (float(part) for part in parts[:2])
        count = int(parts[2]) if len(parts) == 3 else None
    except ValueError:
        raise InputError(f"{where}: {said.strip()!r} is no range; {how}") from None
    if len(parts) > 3:
        raise InputError(f"{where}: {said.strip()!r} is no range; {how}")
    if not (math.isfinite(low) and math.isfinite(high)) or low == high:
        raise InputError(f"{where}: an empty range; its ends must be two different numbers")
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


def _given(said: Any, where: str) -> list[Any]:
    """Values that are no text; numbers of numpy as Python's."""
    if hasattr(said, "tolist"):
        said = said.tolist()
    if isinstance(said, (bool, int, float)):
        return [said]
    if isinstance(said, Mapping) or not isinstance(said, Iterable):
        raise InputError(f"{where}: {shown(said)}: must be a list of values, or text such as '-1:1:5'")
    return [value.tolist() if hasattr(value, "tolist") else value for value in said]


def _listed(said: str, where: str) -> list[Any]:
    """Values with commas between; a bare word is a string, as with `--set`."""
    try:
        return tomllib.loads(f"values = [{said}]")["values"]
    except (ValueError, RecursionError):
        words = [word.strip() for word in said.split(",")]
        if "" in words or any(mark in said for mark in "[]{}\"'="):
            raise InputError(f"{where}: {said!r} is no list; write values with commas between") from None
        return [_word(word) for word in words]


def _word(word: str) -> Any:
    try:
        return tomllib.loads(f"value = {word}")["value"]
    except ValueError:
        return word


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
