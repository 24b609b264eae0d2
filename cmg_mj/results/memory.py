"""Returns what is free in the process to the system."""

from __future__ import annotations

import ctypes
import sys


def release_free_memory() -> None:
    """Return what is free to the system, where the C library can.

    A chunk of a sweep takes and frees some thousand pieces of MuJoCo's, between which glibc's allocator keeps what is
    free: without this a process that holds 145 MB between chunks has 370 after twenty of them. A replay of a long log
    leaves its columns so, phase by phase. Arrow keeps some of its own.
    """
    arrow = sys.modules.get("pyarrow")
    if arrow is not None:
        arrow.default_memory_pool().release_unused()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # musl has none
        if trim is not None:
            trim(0)
