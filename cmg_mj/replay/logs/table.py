"""Reading of some columns of a CSV or Parquet file as numbers; a failure is a message of one line."""

from __future__ import annotations

import codecs
import csv
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.errors import InputError, nearest, shown
from cmg_mj.replay.logs.cells import MISSING, Clock, is_number, numbers
from cmg_mj.replay.logs.columns import HOW_TO_QUOTE
from cmg_mj.results.stored_columns import ColumnStore, StoredColumns, stored

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.csv as pacsv

MOST_ROWS = 5_000_000
"""Most rows of a log; more take hours."""
DELIMITERS = (",", ";", "\t", "|")
ROWS_OF_DELIMITER = 20
"""Number of rows below the heading that show the delimiter: a heading may contain others."""
HEAD = 1 << 16
"""Size of the part of a CSV that is searched for its heading, which must end in it [bytes]."""
PARQUET = b"PAR1"
"""First bytes of a Parquet file."""
COMMENTS = ("#", "%", "//")


def read_table(path: Path, headings: Sequence[str], time: str | None) -> tuple[StoredColumns, list[str], bool]:
    """Read columns of a log; a long one's go to a file, a piece at a time, unless they have text.

    Args:
        path: A CSV (with a heading) or a Parquet file.
        headings: Headings of the columns.
        time: The heading among them that may also hold dates, which become seconds from the first.

    Returns:
        Heading -> numbers, (n_rows,), NaN where there is none; changes that were not requested; whether the time
        holds dates.

    Raises:
        InputError: The file cannot be read, lacks a column, or has text among the numbers.
    """
    head = head_of(path)
    if not head.strip():
        raise InputError(f"{path}: empty")
    notes: list[str] = []
    dated: list[str] = []
    if head.startswith(PARQUET):
        columns = _of_parquet(path, headings, time, dated)
    else:
        columns = _of_csv(path, head, headings, time, notes, dated)
    columns = stored(columns)
    if not columns.n_rows:
        raise InputError(f"{path}: has a heading and no row")
    return columns, notes, bool(dated)


def head_of(path: Path) -> bytes:
    """Read the first bytes of a file.

    Raises:
        InputError: There is no such file, or it cannot be read.
    """
    try:
        if path.is_file():
            with path.open("rb") as file:
                return file.read(HEAD)
        what = "no file" if path.exists() else "no such file"
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:  # such as a name with a zero byte
        raise InputError(f"{str(path)!r}: cannot be read: {error}") from error
    raise InputError(f"{path}: {what}; name a CSV or Parquet file, or the folder of a run")


def _of_parquet(path: Path, headings: Sequence[str], time: str | None, dated: list[str]) -> Mapping[str, np.ndarray]:
    import pyarrow.parquet as pq

    with _arrow_errors(path), path.open("rb") as source:
        file = pq.ParquetFile(source)
        names = file.schema_arrow.names
        _check_columns(path, headings, [name.strip() for name in names])
        spelled = {name.strip(): name for name in names}
        if file.metadata.num_rows > MOST_ROWS:
            raise _too_long(path, file.metadata.num_rows)
        names = list(dict.fromkeys(spelled[name.strip()] for name in headings))
        if all(is_number(file.schema_arrow.field(name).type) for name in names):
            return _in_pieces(path, names, file.iter_batches(columns=names))
        table = file.read(columns=names)
    return {
        name.strip(): numbers(path, name, table[spelled[name.strip()]], dated if name == time else None)
        for name in headings
    }


def _of_csv(
    path: Path, head: bytes, headings: Sequence[str], time: str | None, notes: list[str], dated: list[str]
) -> Mapping[str, np.ndarray]:
    import pyarrow as pa
    import pyarrow.csv as pacsv

    encoding, skipped, line, rows = _heading(path, head)
    delimiter = _delimiter(line, rows)
    comma = delimiter == ";" and "," in line + head.decode(encoding, "replace")
    read = pacsv.ReadOptions(skip_rows=skipped, encoding=encoding, use_threads=False)
    torn: list[str] = []

    def discard(row: pacsv.InvalidRow) -> str:
        torn.append(f"{row.actual_columns} cells instead of {row.expected_columns}: {shown(row.text)}")
        return "skip"

    parse = pacsv.ParseOptions(delimiter=delimiter, invalid_row_handler=discard)

    def convert(kind: pa.DataType) -> pacsv.ConvertOptions:
        return pacsv.ConvertOptions(
            include_columns=list(dict.fromkeys(headings)),
            column_types=dict.fromkeys(headings, kind),
            null_values=MISSING,
            strings_can_be_null=True,
            decimal_point="," if comma else ".",
        )

    with _arrow_errors(path):
        with path.open("rb") as file:
            names = pacsv.open_csv(file, read, parse).schema.names
        _check_columns(path, headings, [name.strip() for name in names], _cells_apart(len(names), rows, delimiter))
        spelled = {name.strip(): name for name in names}
        headings = [spelled[name.strip()] for name in headings]
        time = spelled.get(time.strip()) if time else None
        names = list(dict.fromkeys(headings))
        try:
            torn.clear()
            columns = _in_pieces(path, names, _batches(path, read, parse, convert(pa.float64())))
        except pa.ArrowInvalid as error:
            if "onversion error" not in str(error):
                raise
            torn.clear()
            texts = _batches(path, read, parse, convert(pa.string()))
            clock = Clock(path, time, dated, comma=comma) if time else None
            columns = _in_pieces(path, names, texts, clock, comma=comma)
    if torn and not columns.n_rows:
        raise InputError(f"{path}: no line has as many cells as the heading; the first, {torn[0]}")
    if torn:
        one = len(torn) == 1
        lines = f"{len(torn)} {'line has' if one else 'lines have'} another number of cells"
        notes.append(f"{lines} and {'was' if one else 'were'} discarded; {'' if one else 'the first, '}{torn[0]}")
    return columns


def _batches(
    path: Path, read: pacsv.ReadOptions, parse: pacsv.ParseOptions, convert: pacsv.ConvertOptions
) -> Iterator[pa.RecordBatch]:
    """Read a CSV, a batch at a time, first an empty one; refuse one that is too long."""
    import pyarrow as pa
    import pyarrow.csv as pacsv

    rows = 0
    with path.open("rb") as file, pacsv.open_csv(file, read, parse, convert) as reader:
        yield pa.RecordBatch.from_pylist([], schema=reader.schema)
        for batch in reader:
            rows += len(batch)
            if rows > MOST_ROWS:
                raise _too_long(path, None)
            yield batch


def _in_pieces(
    path: Path,
    names: Sequence[str],
    batches: Iterable[pa.RecordBatch],
    clock: Clock | None = None,
    *,
    comma: bool = False,
) -> StoredColumns:
    """Keep columns of numbers, a batch at a time: a long log's go to a file."""
    import pyarrow as pa

    store = ColumnStore(len(names), Path(tempfile.gettempdir()))

    def values(name: str, column: pa.ChunkedArray) -> np.ndarray:
        if clock is not None and clock.name == name:
            return clock.seconds(column, len(store))
        return numbers(path, name, column, None, comma=comma, first=len(store))

    for batch in batches:
        if len(batch):
            store.append([values(name, pa.chunked_array([batch.column(name)]))[:, None] for name in names])
    readers = {name.strip(): partial(_column, store, i) for i, name in enumerate(names)}
    return StoredColumns(readers, 0, len(store))


def _column(store: ColumnStore, column: int, start: int, end: int) -> np.ndarray:
    return store.read(column, start, end)[:, 0]


def _delimiter(heading: str, rows: Sequence[str]) -> str:
    """Return the delimiter with which most rows have as many cells as the heading; among several, the most frequent."""

    def count(line: str, delimiter: str) -> int:
        return sum(part.count(delimiter) for part in line.split('"')[::2])  # a delimiter in quotes divides nothing

    def fits(delimiter: str) -> tuple[int, int]:
        n = count(heading, delimiter)
        return (sum(count(row, delimiter) == n for row in rows) if n else 0), n

    return max(DELIMITERS, key=fits)


def _heading(path: Path, head: bytes) -> tuple[str, int, str, Sequence[str]]:
    """Return the encoding, the number of lines above the heading (comments, empty ones), it, and some rows below."""
    encoding = "utf-8"
    if head.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
        raise InputError(f"{path}: is written in UTF-32; save it as UTF-8")
    for mark, name in ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if head.startswith(mark):
            encoding = name
    if encoding == "utf-8":
        if b"\0" in head:
            raise InputError(f"{path}: neither CSV nor Parquet")
        encoding = "utf-8" if _is_utf8(path) else "latin-1"
    lines = head.decode(encoding, "ignore").lstrip("\ufeff").splitlines()
    for i, line in enumerate(lines):
        if line.strip() and not line.lstrip().startswith(COMMENTS):
            return encoding, i, line, lines[i + 1 : i + 1 + ROWS_OF_DELIMITER]
    raise InputError(f"{path}: no heading in its first {HEAD // 1024} kB")


def _is_utf8(path: Path) -> bool:
    """Return whether all of a file is UTF-8."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    with path.open("rb") as file:
        try:
            while chunk := file.read(1 << 20):
                decoder.decode(chunk)
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            return False
    return True


def _cells_apart(n_heading: int, rows: Sequence[str], delimiter: str) -> str:
    """Say that all rows below a heading have another number of cells, if they have."""
    numbers_of_cells = {len(cells) for cells in csv.reader(rows, delimiter=delimiter) if cells}
    if len(numbers_of_cells) != 1 or n_heading in numbers_of_cells:
        return ""
    n_row = numbers_of_cells.pop()
    apart = f"; its heading has {n_heading} cells, and the rows below it have {n_row}"
    if n_heading > n_row:
        apart += f": one with {shown(delimiter)} in it must be in quotes in the file too"
    return apart


def _check_columns(path: Path, headings: Sequence[str], names: Sequence[str], cells_apart: str = "") -> None:
    for name in headings:
        if name.strip() not in [known.strip() for known in names]:
            few = [shown(known) for known in names]
            quoted = HOW_TO_QUOTE if any("," in known for known in names) else ""
            guess = nearest(name, few, "it has", quoted=True)
            raise InputError(f"{path}: has no column {name!r}; {guess}{cells_apart or quoted}")
        if list(names).count(name) > 1:
            raise InputError(f"{path}: has the column {name!r} {list(names).count(name)} times: rename all but one")


def _too_long(path: Path, rows: int | None) -> InputError:
    has = "more" if rows is None else f"{rows:,} rows, more"
    return InputError(f"{path}: {has} than {MOST_ROWS:,} rows: cut out a part of it")


@contextmanager
def _arrow_errors(path: Path) -> Iterator[None]:
    """Raise Arrow's errors as messages of one line."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, OSError, UnicodeError, OverflowError) as error:
        text = " ".join(str(getattr(error, "strerror", None) or error).split())
        if "straddling object" in text:
            text = "a line is longer than a megabyte"
        raise InputError(f"{os.fspath(path)}: cannot be read: {text[:200]}") from error
