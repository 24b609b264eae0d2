"""The line of a user's own code that an exception came from."""

from __future__ import annotations

import os
import sysconfig
from pathlib import Path
from types import TracebackType

_OURS = f"{Path(__file__).resolve().parents[1]}{os.sep}"
_STANDARD = sysconfig.get_path("stdlib"), sysconfig.get_path("platstdlib")
_OTHERS = {"site-packages", "dist-packages"}


def users_line(traceback: TracebackType | None) -> str | None:
    """Return `own.py, line 12` for the innermost line that is neither cmg_mj's nor a library's; None without one.

    Args:
        traceback: From a frame of cmg_mj's on.
    """
    line = None
    while traceback is not None:
        file = traceback.tb_frame.f_code.co_filename
        path = Path(file).absolute()
        if path.exists() and not str(path).startswith((_OURS, *_STANDARD)) and _OTHERS.isdisjoint(path.parts):
            line = f"{path.name}, line {traceback.tb_lineno}"
        traceback = traceback.tb_next
    return line
