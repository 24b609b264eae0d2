"""Gives memory that is free in the process back to the system."""

from __future__ import annotations

import ctypes
import sys


def release_memory() -> None:
    """Give freed memory back to the system, where the C library can.

    The heap keeps what is freed below its end, and Arrow what it may want again: after a long log, more than 100 MB.
    """
    arrow = sys.modules.get("pyarrow")
    if arrow is not None:
        arrow.default_memory_pool().release_unused()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # a function of glibc's
        if trim is not None:
            trim(0)
