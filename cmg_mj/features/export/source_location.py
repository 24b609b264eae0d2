"""Locates in the user's code what cannot be exported."""

from __future__ import annotations

import linecache
import os
import sys
from pathlib import Path
from types import FrameType, TracebackType

import numpy as np

from cmg_mj.core.errors import InputError

_LIBRARY_PATHS = (
    str(Path(__file__).parent),
    str(Path(np.__file__).parent),
    str(Path(__file__).parents[2] / "elementwise"),
)


class NotExportable(InputError):
    """An operation that no formula can express."""


class LawNotExportable(InputError):
    """A control law that cannot be exported; all else is the observer's."""


def here() -> str:
    """Locate the running line, the innermost one outside this package: `(own.py, line 12: if y1 > 0.1:)`."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_code.co_filename.startswith(_LIBRARY_PATHS):
        frame = frame.f_back
    return "" if frame is None else _format_line(frame.f_code.co_filename, frame.f_lineno)


def raised_at(traceback: TracebackType | None) -> str:
    """Locate the innermost line of the user's code that an exception came from."""
    place = ""
    while traceback is not None:
        file = traceback.tb_frame.f_code.co_filename
        if not file.startswith(_LIBRARY_PATHS):
            place = _format_line(file, traceback.tb_lineno)
        traceback = traceback.tb_next
    return place


def _format_line(file: str, line: int) -> str:
    text = linecache.getline(file, line).strip()
    near = os.path.relpath(file)
    name = near if len(near) < len(file) else file
    return f"({name}, line {line}{': ' if text else ''}{text})"
