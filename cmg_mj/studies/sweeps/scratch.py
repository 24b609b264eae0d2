"""A folder in the temporary one for the workers of a sweep, which the next sweep removes after a kill."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cmg_mj.results.files import is_plain_file
from cmg_mj.results.run_folder.lock import Busy, Lock

PREFIX = "cmg-mj-"
LOCK, OURS = "lock", "cmg_mj_scratch"
"""Files in the folder. The second is written while the lock is held: if the lock is free, its process has ended."""


@contextmanager
def scratch_folder() -> Iterator[str]:
    """Make a folder, and remove it at the end; first remove those of processes that have ended without doing so.

    Yields:
        The folder.
    """
    _clear_left_over(Path(tempfile.gettempdir()))
    with tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True) as scratch:
        lock = Lock(Path(scratch) / LOCK)
        try:
            (Path(scratch) / OURS).touch()
            yield scratch
        finally:
            lock.release()


def _clear_left_over(parent: Path) -> None:
    """Remove scratch folders whose process has ended; what is another user's, or anything else's, stays."""
    for folder in parent.glob(f"{PREFIX}*"):
        with suppress(Busy, OSError):
            if not _is_ours(folder):
                continue
            lock = Lock(folder / LOCK)
            try:
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                lock.release()


def _is_ours(folder: Path) -> bool:
    """Return whether `scratch_folder` has made a folder, for this user."""
    own = not hasattr(os, "getuid") or folder.lstat().st_uid == os.getuid()
    files = folder / LOCK, folder / OURS
    return own and not folder.is_symlink() and all(is_plain_file(file) for file in files)
