"""Reads text files that a user names, of limited size."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from cmg_mj.errors import InputError


class TextFormat(NamedTuple):
    """The requirements on a text file."""

    noun: str
    """Noun for the file in messages: `scenario`."""
    largest: int
    """Largest size of the file [bytes]."""
    encoding: str
    not_text: str
    """Message on bytes that are no text in the encoding."""


def read_text(path: Path, name: str, text_format: TextFormat) -> str:
    """Read a text file that a user names.

    Args:
        path: The file.
        name: What to call it in messages.
        text_format: What it must be.

    Returns:
        Its text.

    Raises:
        InputError: It is larger, is no text in the encoding, or cannot be read.
    """
    try:
        if path.stat().st_size > text_format.largest:
            raise InputError(f"{name}: larger than {_size(text_format.largest)}, which no {text_format.noun} is")
        return path.read_text(encoding=text_format.encoding)
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: {text_format.not_text} (at byte {error.start})") from error
    except OSError as error:
        raise InputError(f"{name}: cannot be read: {error.strerror}") from error


def _size(count: int) -> str:
    return f"{count // 1_000_000} MB" if count > 1_000_000 else f"{count // 1000} kB"
