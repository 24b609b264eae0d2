"""Text files that stand alone and yet are known to be cmg_mj's: their first line has the SHA-256 of the others."""

from __future__ import annotations

import hashlib
from pathlib import Path

from cmg_mj.results.files import is_plain_file

OPENINGS = {".xml": ("<!-- ", " -->"), ".toml": ("# ", "")}
"""Ending of a file -> how a comment begins and ends there."""
SAYS = "Written by cmg-mj mount, which replaces this file only as it is; SHA-256 of the lines below: "
LONGEST_FIRST_LINE = 300
"""Bytes of a first line; a longer one is not cmg_mj's."""


def signed(text: str, ending: str) -> bytes:
    """Put the line above a text by which `is_as_written` knows it again.

    Args:
        text: The text.
        ending: `.xml` or `.toml`.

    Returns:
        The content of the file.
    """
    content = text.encode()
    return _first_line(hashlib.sha256(content).hexdigest(), ending) + content


def is_as_written(path: Path) -> bool:
    """Return whether a file is as `signed` made it, to the last byte. One that has changed since is the user's.

    Args:
        path: A file that ends in `.xml` or `.toml`.
    """
    if not is_plain_file(path):
        return False
    with path.open("rb") as file:
        first = file.readline(LONGEST_FIRST_LINE)
        return first == _first_line(hashlib.file_digest(file, "sha256").hexdigest(), path.suffix)


def is_begun(path: Path) -> bool:
    """Return whether a file holds the beginning of what `signed` makes, or nothing: its writing was cut off."""
    if not is_plain_file(path):
        return False
    begins = (OPENINGS[".xml"][0] + SAYS).encode(), (OPENINGS[".toml"][0] + SAYS).encode()
    with path.open("rb") as file:
        head = file.read(LONGEST_FIRST_LINE)
    return any(head[: len(begin)] == begin[: len(head)] for begin in begins)


def _first_line(digest: str, ending: str) -> bytes:
    begin, end = OPENINGS[ending]
    return f"{begin}{SAYS}{digest}{end}\n".encode()
