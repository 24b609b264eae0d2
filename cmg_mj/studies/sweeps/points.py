"""The points of a sweep: the values of the varied fields, made from a point's number on demand."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from cmg_mj.studies.sweeps.axes import FieldValue, VariedField

Point = dict[str, FieldValue]
"""Varied field -> its value."""


class Points:
    """Points by their numbers. A hundred thousand of them as dictionaries would take 30 MB and more.

    Args:
        axes: The varied fields.
        shares: The place of a design's points in the axes' ranges, (n_points, n_axes); None for a grid: every
            combination of values, of which the last field's change first.
    """

    def __init__(self, axes: Sequence[VariedField], shares: np.ndarray | None = None) -> None:
        self._fields = [axis.fields for axis in axes]
        self._columns: list[Sequence[FieldValue]] | None = None
        if shares is None:
            self._values = [axis.values for axis in axes]
            self._length = math.prod(len(values) for values in self._values)
        else:
            self._columns = [_packed(axis.at(share)) for axis, share in zip(axes, shares.T, strict=True)]
            self._length = len(shares)

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[Point]:
        return (self[number] for number in range(self._length))

    def __getitem__(self, number: int) -> Point:
        if not 0 <= number < self._length:
            raise IndexError(number)
        if self._columns is not None:
            row = [column[number] for column in self._columns]
        else:
            row = []
            for values in reversed(self._values):
                number, place = divmod(number, len(values))
                row.insert(0, values[place])
        return {field: value for fields, value in zip(self._fields, row, strict=True) for field in fields}


def _packed(values: list[FieldValue]) -> Sequence[FieldValue]:
    """Store numbers in as few bytes as they take."""
    floats = [value for value in values if type(value) is float]
    return array("d", floats) if len(floats) == len(values) else values


def sampled(dimensions: int, n: int, seed: int, *, indices: bool) -> np.ndarray:
    """Spread points evenly in the unit cube, (n_points, dimensions).

    For indices the points are those of Saltelli's scheme, as `scipy.stats.sobol_indices` wants them: A, B, then A with
    each column in turn from B.
    """
    from scipy.stats import qmc  # half a second

    # The argument is called `rng` since 1.15; all versions take this name.
    generator: Any = {"seed": np.random.default_rng(seed)}

    if not indices:
        import warnings

        with warnings.catch_warnings():  # that n is no power of two
            warnings.simplefilter("ignore", UserWarning)
            return qmc.Sobol(dimensions, **generator).random(n)
    both = qmc.Sobol(2 * dimensions, **generator).random(n)
    a, b = both[:, :dimensions], both[:, dimensions:]
    crossed = [np.where(np.arange(dimensions) == i, b, a) for i in range(dimensions)]
    return np.concatenate([a, b, *crossed])
