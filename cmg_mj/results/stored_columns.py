"""Columns of ticks that come piece by piece; of a long run most are in a file, and read when they are asked for."""

from __future__ import annotations

import tempfile
import threading
import weakref
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

STRETCH = 32768
"""Number of rows that are written, read or recorded at once: shorter runs are handled whole."""
LONG = 262144
"""Number of rows from which columns of a log do not stay in memory, and are handled in stretches of so many rows."""

Reader = Callable[[int, int], np.ndarray]
"""Returns the rows of one column from one row up to another, without the latter."""


class StoredColumns(Mapping[str, np.ndarray]):
    """Columns by name; each look-up reads the column anew.

    Args:
        readers: Name -> what reads the column.
        first: The first row.
        end: The row after the last one.
    """

    def __init__(self, readers: Mapping[str, Reader], first: int, end: int) -> None:
        self._readers, self._first, self._end = readers, first, end

    def __getitem__(self, name: str) -> np.ndarray:
        return self._readers[name](self._first, self._end)

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)

    def __contains__(self, name: object) -> bool:
        return name in self._readers

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return self._end - self._first

    def read(self, name: str, rows: slice) -> np.ndarray:
        """Read successive rows of one column."""
        return self.rows(rows)[name]

    def rows(self, rows: slice) -> StoredColumns:
        """Select successive rows."""
        first, end, _ = rows.indices(self._end - self._first)
        return StoredColumns(self._readers, self._first + first, self._first + max(first, end))

    def renamed(self, names: Mapping[str, str]) -> StoredColumns:
        """Select columns: new name -> the one they have."""
        return StoredColumns({new: self._readers[name] for new, name in names.items()}, self._first, self._end)

    def joined(self, other: StoredColumns) -> StoredColumns:
        """Add the columns of another of equal length."""
        return StoredColumns({**self._readers, **other._readers}, self._first, self._end)


class _InFile:
    """Rows in a file, column after column.

    Args:
        file: The file.
        offset: Offset of their first value [values].
        n_rows: Number of rows.
    """

    def __init__(self, file: _ValueFile, offset: int, n_rows: int) -> None:
        self._file, self._offset, self._n_rows = file, offset, n_rows

    def read(self, column: int, start: int, end: int) -> np.ndarray:
        return self._file.read(self._offset + column * self._n_rows + start, end - start)[:, None]


class _InMemory:
    """Rows in memory."""

    def __init__(self, columns: Sequence[np.ndarray]) -> None:
        self._columns = columns

    def read(self, column: int, start: int, end: int) -> np.ndarray:
        return self._columns[column][start:end]


class _ValueFile:
    """A file of floats without a name, which the system removes with the process."""

    def __init__(self, folder: Path) -> None:
        self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115  (read as long as this lives)
        weakref.finalize(self, self._file.close)
        self._lock = threading.Lock()  # a live view reads in a thread of its own
        self._end = 0

    def append(self, values: np.ndarray) -> int:
        """Append values; return the offset of the first one."""
        offset = self._end
        with self._lock:
            self._file.seek(8 * offset)
            self._file.write(np.ascontiguousarray(values, dtype=float).data)
        self._end += values.size
        return offset

    def read(self, offset: int, count: int) -> np.ndarray:
        values = np.empty(count)
        with self._lock:
            self._file.seek(8 * offset)
            self._file.readinto(values.data)
        return values


class ColumnStore:
    """Pieces of some columns, in order.

    Args:
        n_columns: Number of columns.
        folder: Folder for a file without a name, to which the rows of one world go as soon as they are a stretch; None
            to keep them in memory. Rows that the disk does not take stay in memory too.
    """

    def __init__(self, n_columns: int, folder: Path | None = None) -> None:
        self.n_columns = n_columns
        self._folder = folder
        self._file: _ValueFile | None = None
        self._pieces: list[_InFile | _InMemory] = []
        self._starts: list[int] = []
        self._n_written = 0
        self._end = 0

    def __len__(self) -> int:
        return self._end

    @property
    def in_memory(self) -> bool:
        """True if no row is in a file."""
        return self._file is None

    def append(self, columns: Sequence[np.ndarray]) -> None:
        """Add rows, (n_rows, n_worlds) a column."""
        self._add(_InMemory(columns), len(columns[0]))
        if self._folder is not None and self._end - self._n_written >= STRETCH:
            try:
                self._write(self._folder)
            except OSError:  # the files of the run will not fit either, and it is said then
                self._folder = None

    def _add(self, piece: _InFile | _InMemory, n_rows: int) -> None:
        self._pieces.append(piece)
        self._starts.append(self._end)
        self._end += n_rows

    def _write(self, folder: Path) -> None:
        """Move what is in memory to the file."""
        first, n_rows = self._n_written, self._end - self._n_written
        block = np.stack([self.read(i, first, self._end)[:, 0] for i in range(self.n_columns)])
        self._file = self._file or _ValueFile(folder)
        piece = _InFile(self._file, self._file.append(block), n_rows)
        kept = bisect_right(self._starts, first - 1)
        del self._pieces[kept:], self._starts[kept:]
        self._end = first
        self._add(piece, n_rows)
        self._n_written = self._end

    def read(self, column: int, start: int, end: int) -> np.ndarray:
        """Read rows of one column, (n_rows, n_worlds)."""
        first = max(0, bisect_right(self._starts, start) - 1)
        last = bisect_left(self._starts, end)
        ends = [*self._starts[first + 1 : last + 1], self._end]
        parts = (
            piece.read(column, max(0, start - begin), min(end, until) - begin)
            for piece, begin, until in zip(self._pieces[first:last], self._starts[first:last], ends, strict=False)
            if start < until
        )
        if self.in_memory:
            known = list(parts)
            return np.concatenate(known) if known else np.zeros((0, 1))
        values, n_rows = np.empty((max(0, min(end, self._end) - start), 1)), 0
        for part in parts:  # one by one: of a long column, twice the values take much memory
            values[n_rows : n_rows + len(part)] = part
            n_rows += len(part)
        return values


def stored(columns: Mapping[str, np.ndarray]) -> StoredColumns:
    """Take arrays of equal length as stored columns; those in a file already stay there."""
    if isinstance(columns, StoredColumns):
        return columns
    n_rows = max((len(values) for values in columns.values()), default=0)
    return StoredColumns({name: _rows_of(values) for name, values in columns.items()}, 0, n_rows)


def _rows_of(values: np.ndarray) -> Reader:
    return lambda start, end: values[start:end]


def shelved(values: np.ndarray) -> Reader:
    """Put a long array into a file of its own; a short one stays in memory."""
    if len(values) <= LONG:
        return _rows_of(values)
    store = ColumnStore(1, Path(tempfile.gettempdir()))
    for rows in stretches(len(values)):
        store.append([values[rows, None].copy()])  # a view of the last rows would keep the whole array
    return lambda start, end: store.read(0, start, end)[:, 0]


def stretches(n_rows: int, length: int | None = None) -> Iterator[slice]:
    """Divide rows into stretches of at most `LONG`, or of another length."""
    length = length or LONG
    return (slice(start, min(start + length, n_rows)) for start in range(0, n_rows, length))


def number_of_rows(columns: Mapping[str, np.ndarray]) -> int:
    """Return the number of rows, without reading any."""
    return columns.n_rows if isinstance(columns, StoredColumns) else len(next(iter(columns.values())))


def select_rows(columns: Mapping[str, np.ndarray], rows: slice) -> Mapping[str, np.ndarray]:
    """Select successive rows of each column."""
    return columns.rows(rows) if isinstance(columns, StoredColumns) else {k: v[rows] for k, v in columns.items()}


def masked(columns: Mapping[str, np.ndarray], mask: np.ndarray) -> StoredColumns:
    """Select rows by a mask, (n_rows,)."""
    whole = stored(columns)
    if mask.all():
        return whole
    return StoredColumns({name: shelved(values[mask]) for name, values in whole.items()}, 0, int(mask.sum()))


def reversed_rows(columns: StoredColumns) -> StoredColumns:
    """Turn the order of the rows round."""
    return StoredColumns({name: shelved(values[::-1]) for name, values in columns.items()}, 0, columns.n_rows)
