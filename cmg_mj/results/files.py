"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa


def is_plain_file(path: Path) -> bool:
    """Return whether this is a file, and neither a link to one nor a pipe or a device."""
    return path.is_file() and not path.is_symlink()


@contextmanager
def whole_file(path: Path, ending: str = "") -> Iterator[Path]:
    """Give a temporary name to write to; rename it to `path` at the end, or remove it if the writing failed.

    Args:
        path: The file.
        ending: Ending of the temporary name, for readers that go by it.

    Yields:
        The temporary file.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.partial{ending}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file that outlasts a power cut."""
    with whole_file(path) as temporary, temporary.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def write_parquet(path: Path, table: pa.Table, *, durable: bool = False) -> None:
    """Write a table as Parquet.

    Args:
        path: The file.
        table: The table.
        durable: Whether the file must outlast a power cut.
    """
    write_row_groups(path, [table], durable=durable)


def write_row_groups(path: Path, tables: Iterable[pa.Table], *, durable: bool = False) -> None:
    """Write tables with the same columns as one Parquet file, a row group each.

    Args:
        path: The file.
        tables: The tables, at least one; each is written before the next is asked for.
        durable: Whether the file must outlast a power cut.
    """
    import pyarrow.parquet as pq

    # Opened here: Arrow takes no path with bytes that are no UTF-8.
    with whole_file(path) as temporary, temporary.open("wb") as file:
        writer = None
        for table in tables:
            writer = writer or pq.ParquetWriter(file, table.schema)
            writer.write_table(table)
        assert writer is not None
        writer.close()
        if durable:
            file.flush()
            os.fsync(file.fileno())
