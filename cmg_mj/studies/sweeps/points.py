"""The points of a sweep: what is varied, by its number, made when it is asked for."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Sequence
from typing import Any, overload

import numpy as np

from cmg_mj.studies.sweeps.axes import VariedField

Point = dict[str, Any]
"""Field -> its value."""


class Points:
    """Points by their numbers. A hundred thousand of them as dictionaries would take 30 MB and more.

    Args:
        axes: What is varied.
        shares: Where each point lies in the axes' ranges, (n_points, n_axes), of a design; None for a grid: every
            combination of values, of which the last field's change first.
    """

    def __init__(self, axes: Sequence[VariedField], shares: np.ndarray | None = None) -> None:
        self._fields = [axis.fields for axis in axes]
        self._columns: list[Sequence[Any]] | None = None
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

    @overload
    def __getitem__(self, number: int) -> Point: ...

    @overload
    def __getitem__(self, number: slice) -> list[Point]: ...

    def __getitem__(self, number: int | slice) -> Point | list[Point]:
        if isinstance(number, slice):
            return [self[each] for each in range(self._length)[number]]
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


def _packed(values: list[Any]) -> Sequence[Any]:
    """As few bytes as they take."""
    return array("d", values) if all(type(value) is float for value in values) else values


def sampled(dimensions: int, n: int, seed: int, *, indices: bool) -> np.ndarray:
    """Points in the unit cube, evenly spread, (n_points, dimensions).

    For indices they are those of Saltelli's scheme, as `scipy.stats.sobol_indices` wants them: A, B, then A with each
    column in turn from B.
    """
    from scipy.stats import qmc  # half a second

    generator: Any = {"seed": np.random.default_rng(seed)}  # called `rng` since 1.15; this name all versions take

    if not indices:
        import warnings

        with warnings.catch_warnings():  # that n is no power of two
            warnings.simplefilter("ignore", UserWarning)
            return qmc.Sobol(dimensions, **generator).random(n)
    both = qmc.Sobol(2 * dimensions, **generator).random(n)
    a, b = both[:, :dimensions], both[:, dimensions:]
    crossed = [np.where(np.arange(dimensions) == i, b, a) for i in range(dimensions)]
    return np.concatenate([a, b, *crossed])
