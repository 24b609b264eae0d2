"""Cells of a log's table as numbers: text, dates, missing ones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.errors import InputError, shown

if TYPE_CHECKING:
    import pyarrow as pa

NOT_FINITE = ["nan", "NaN", "NAN", "-nan", "inf", "-inf", "Inf", "-Inf"]
MISSING = ["", "NA", "N/A", "#N/A", "null", "NULL", "None", "none", *NOT_FINITE]
"""Cells that hold no number."""


class Clock:
    """Converts a column of text, piece by piece: dates to seconds from the first, numbers as they are.

    Args:
        path: The file, for messages.
        name: The column's heading.
        dated: Gets the heading if the first piece with a cell holds dates.
        comma: Whether numbers have a decimal comma.
    """

    def __init__(self, path: Path, name: str, dated: list[str], *, comma: bool) -> None:
        self.name = name
        self._path, self._dated, self._comma = path, dated, comma
        self._are_dates: bool | None = None
        self._start: int | None = None

    def seconds(self, column: pa.ChunkedArray, first: int) -> np.ndarray:
        """Convert a piece whose first row is given."""
        import pyarrow as pa
        import pyarrow.compute as pc

        if column.null_count == len(column):
            return np.full(len(column), np.nan)
        if self._are_dates is not False:
            text = pc.call_function("utf8_trim_whitespace", [column])
            try:
                stamps = text.cast(pa.timestamp("ns"))
            except pa.ArrowInvalid:
                if self._are_dates:
                    raise _mixed(self._path, self.name, text, first) from None
            else:
                if self._are_dates is None:
                    self._dated.append(self.name)
                self._are_dates = True
                values, self._start = _seconds(stamps, self._start)
                return values
        self._are_dates = False
        return numbers(self._path, self.name, column, [], comma=self._comma, first=first)


def _mixed(path: Path, name: str, text: pa.ChunkedArray, first: int) -> InputError:
    """Name the first cell that is no date, in a column of dates."""
    import pyarrow as pa

    def is_date(i: int) -> bool:
        try:
            text.slice(i, 1).cast(pa.timestamp("ns"))
        except pa.ArrowInvalid:
            return False
        return True

    i = next(i for i in range(len(text)) if not is_date(i))
    cell = shown(str(text[i].as_py()))
    return InputError(f"{path}: row {first + i + 1}, column {name!r}: {cell} is not a date, as the rows before")


def is_number(kind: pa.DataType) -> bool:
    """Return whether a column's type is one of numbers."""
    import pyarrow as pa

    return pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)


def numbers(
    path: Path, name: str, column: pa.ChunkedArray, dated: list[str] | None, *, comma: bool = False, first: int = 0
) -> np.ndarray:
    """Convert a column to floats.

    Args:
        path: The file, for messages.
        name: The column's heading.
        column: The column.
        dated: Gets the heading if the column holds dates, which become seconds from the first; None to refuse them.
        comma: Whether numbers have a decimal comma.
        first: Number of the column's first row, for messages.

    Returns:
        The numbers, NaN where there is none.

    Raises:
        InputError: A cell is no number, or the column of no such type.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        if dated is None:
            raise InputError(f"{path}: column {name!r} holds times, not numbers")
        dated.append(name)
        return _seconds(column)[0]
    if is_number(kind):
        values = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False).astype(float)
        return np.where(np.isfinite(values), values, np.nan)
    if pa.types.is_null(kind):
        raise InputError(f"{path}: column {name!r} has no number at all")
    if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
        raise InputError(f"{path}: column {name!r} holds {kind}, not numbers")
    text = pc.call_function("utf8_trim_whitespace", [column])
    if dated is not None:
        try:
            seconds, _ = _seconds(text.cast(pa.timestamp("ns")))
            dated.append(name)
            return seconds
        except pa.ArrowInvalid:
            pass  # numbers, or neither
    values = np.empty(len(text))
    for i, cell in enumerate(text.to_pylist()):
        try:
            values[i] = np.nan if cell is None or cell in MISSING else float(cell.replace(",", ".") if comma else cell)
        except ValueError:
            expected = "a number or a date" if dated is not None else "a number"
            raise InputError(
                f"{path}: row {first + i + 1}, column {name!r}: {shown(str(cell))} is not {expected}"
            ) from None
    return np.where(np.isfinite(values), values, np.nan)


def _seconds(column: pa.ChunkedArray, start: int | None = None) -> tuple[np.ndarray, int | None]:
    """Convert dates, or spans of time, to seconds from the first; nanoseconds are subtracted as integers.

    Args:
        column: The dates.
        start: The first one, if it is in a piece before [ns].

    Returns:
        The seconds, and the first one.
    """
    import pyarrow as pa

    kind = pa.duration("ns") if pa.types.is_duration(column.type) else pa.timestamp("ns")
    if pa.types.is_timestamp(column.type) and column.type.tz:
        column = column.cast(pa.timestamp(column.type.unit))
    column = column.cast(kind).combine_chunks()
    known = np.asarray(column.is_valid())
    counts = column.cast(pa.int64()).fill_null(0).to_numpy(zero_copy_only=False)
    if start is None and known.any():
        start = int(counts[known][0])
    return np.where(known, (counts - (start or 0)) * 1e-9, np.nan), start
