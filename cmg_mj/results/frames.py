"""Named columns and tables as pandas frames."""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from cmg_mj.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa


def require_pandas() -> Any:
    """Import pandas.

    Returns:
        The module.

    Raises:
        InputError: pandas is not installed.
    """
    try:
        return importlib.import_module("pandas")
    except ImportError as error:
        raise InputError(
            "to_pandas: pandas is not installed. Install it with `python -m pip install pandas`, or use the columns "
            "without it: dict(...) has them as NumPy arrays"
        ) from error


def frame_of(table: pa.Table) -> pd.DataFrame:
    """Convert a table.

    Raises:
        InputError: pandas is not installed.
    """
    require_pandas()
    return table.to_pandas()


def columns_of(table: pa.Table) -> dict[str, np.ndarray]:
    """Convert a table's columns to arrays; a number that is missing is NaN, a text that is missing None."""
    return {name: table[name].to_numpy() for name in table.column_names}


class NoArray:
    """An object that is neither an array nor a frame by itself.

    `pandas.DataFrame` would make one column of such an object's names, without a word.
    """

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NoReturn:
        name = type(self).__name__
        raise InputError(f"{name}: is no array and no pandas.DataFrame. Call its to_pandas(), or pass dict(...) of it")


class NamedColumns(NoArray, ABC):
    """Columns by name, with the conventions of a pandas frame: iteration gives names, `len` counts rows."""

    @abstractmethod
    def _columns(self) -> Mapping[str, np.ndarray]:
        """Return the columns, in order."""

    def keys(self) -> list[str]:
        """List the columns' names, in order; with it `dict(...)` takes all columns."""
        return list(self._columns())

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns())

    def __contains__(self, name: object) -> bool:
        return name in self._columns()

    def __getitem__(self, name: str) -> np.ndarray:
        return self._columns()[name]

    def __len__(self) -> int:
        return len(next(iter(self._columns().values())))

    @abstractmethod
    def to_pandas(self) -> pd.DataFrame:
        """Make a frame."""
