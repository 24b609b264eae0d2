"""A lock that dies with its process."""

from __future__ import annotations

import os
import sys
from pathlib import Path

MOST_TRIES = 1000
"""Most times that a folder is taken away while a lock is being made in it."""


class Busy(Exception):
    """Another process, or another part of this one, holds the lock."""


class Lock:
    """A lock file, held from here on; gone with `release`, and free for the next however the process ends.

    filelock, the library, leaves its file behind or takes it away while another waits for it; here it is looked after
    whether the file locked is still the one that has the name.

    Attributes:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        """Take the lock.

        Args:
            path: The file, which is made, as is its folder.

        Raises:
            Busy: Another holds it.
            OSError: The file cannot be made.
        """
        self.path = path
        self._descriptor = -1
        tries = 0
        while self._descriptor < 0:
            tries += 1
            path.parent.mkdir(exist_ok=True)
            try:
                descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
            except FileNotFoundError:
                if tries > MOST_TRIES or not path.parent.parent.is_dir():  # no file can be made in /proc
                    raise
                continue  # the one before has just taken the folder away
            if not _lock(descriptor):
                os.close(descriptor)
                raise Busy
            if self.is_the_file(path, descriptor):
                self._descriptor = descriptor
            else:  # the one before has just taken the file away: nobody else would see this lock
                os.close(descriptor)

    def is_the_file(self, path: Path, descriptor: int | None = None) -> bool:
        """Return whether the locked file has this name, too."""
        try:
            return os.path.samestat(os.fstat(self._descriptor if descriptor is None else descriptor), os.stat(path))
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Let go, and take the file away."""
        if self._descriptor < 0:
            return
        if sys.platform == "win32":  # where an open file cannot be taken away
            os.close(self._descriptor)
            self.path.unlink(missing_ok=True)
        else:
            self.path.unlink(missing_ok=True)
            os.close(self._descriptor)
        self._descriptor = -1


def _lock(descriptor: int) -> bool:
    """Lock an open file: False if another has locked it. Where files cannot be locked at all, nobody is refused."""
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # some network file systems
        return True
    return True
