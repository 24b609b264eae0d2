"""The line of a user's own code that an exception came from."""

from __future__ import annotations

import os
import sysconfig
from pathlib import Path
from types import TracebackType

_PACKAGE = str(Path(__file__).resolve().parents[1])
_LIBRARIES = (_PACKAGE, *(sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")))


def users_line(traceback: TracebackType | None) -> str | None:
    """Return `own.py, line 12` for the innermost line that is neither cmg_mj's nor a library's; None without one.

    Args:
        traceback: From a frame of cmg_mj's on.
    """
    line = None
    while traceback is not None:
        file = traceback.tb_frame.f_code.co_filename
        if os.path.exists(file) and not os.path.abspath(file).startswith(_LIBRARIES):
            line = f"{os.path.basename(file)}, line {traceback.tb_lineno}"
        traceback = traceback.tb_next
    return line
