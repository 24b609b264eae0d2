"""Files that are written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pyarrow as pa

METADATA_KEY = b"cmg_mj"
"""The key of what cmg_mj says of a table, as JSON, in the metadata of its Parquet file."""


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


def write_parquet(path: Path, table: pa.Table, metadata: Mapping[str, Any] | None = None) -> None:
    """Write a table as Parquet.

    Args:
        path: The file.
        table: The table.
        metadata: What the file says of the table beside it; by default nothing.
    """
    write_row_groups(path, [table], metadata)


def write_row_groups(path: Path, tables: Iterable[pa.Table], metadata: Mapping[str, Any] | None = None) -> None:
    """Write tables with the same columns as one Parquet file, a row group each.

    Args:
        path: The file.
        tables: The tables, at least one; each is written before the next is asked for.
        metadata: What the file says of the table beside it; by default nothing.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    stored = None if metadata is None else {METADATA_KEY: json.dumps(metadata).encode()}
    # Opened here: Arrow takes no path with bytes that are no UTF-8.
    with whole_file(path) as temporary, temporary.open("wb") as file:
        writer = None
        for rows in tables:
            table = rows if stored is None else rows.replace_schema_metadata(stored)
            writer = writer or pq.ParquetWriter(file, table.schema)
            writer.write_table(table)
            pa.default_memory_pool().release_unused()  # of a long file, hundreds of row groups pile up
        assert writer is not None
        writer.close()
