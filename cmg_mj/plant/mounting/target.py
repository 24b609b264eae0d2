"""The files that a mount writes: claimed while it lives, replaced only if a mount wrote them, cleared after a kill."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from cmg_mj.errors import InputError, listed
from cmg_mj.results.run_folder.lock import Busy, Lock
from cmg_mj.results.signed_text import is_as_written, is_begun

_PARTIAL = re.compile(r"\.+(?P<stem>.+?)\.(?P<process>\d+)\.partial(\.trial)?\.(xml|toml)(\.\d+\.partial(\.xml)?)?")
"""Names under which a mount writes before it renames (`mounted.with_scenario`); `trial` is a larger scale."""


@contextmanager
def claimed_target(target: Path, *, overwrite: bool) -> Iterator[None]:
    """Claim a model's file and the scenario beside it, and take away what killed mounts have left in their folder.

    Args:
        target: The model's file, in a folder that is there.
        overwrite: Whether files of an earlier mount may be replaced.

    Raises:
        InputError: Another mount writes the same files, one of them may not be replaced, or the folder cannot be
            written.
    """
    try:
        _clear_left_over(target.parent)
        check_replaceable(target, overwrite=overwrite)
        lock = Lock(_lock_file(target.parent, target.stem))
    except Busy:
        raise InputError(f"-o {target}: another mount is writing it") from None
    except OSError as error:
        raise InputError(f"-o {target}: cannot be written: {error.strerror}") from error
    try:
        yield
    finally:
        with suppress(OSError):
            lock.release()


def check_replaceable(target: Path, *, overwrite: bool) -> None:
    """Refuse to replace what no mount has written, or what has changed since.

    Args:
        target: The model's file.
        overwrite: Whether it and the scenario beside it may be replaced, if a mount has written them.

    Raises:
        InputError: One of the files is there and may not be replaced.
        OSError: It cannot be read.
    """
    there = [file for file in (target, target.with_suffix(".toml")) if os.path.lexists(file)]
    check_written_by_mount(target, there)
    if there and not overwrite:
        raise InputError(f"-o {target}: {there[0]} exists; give another name, or --overwrite")


def check_written_by_mount(target: Path, files: Sequence[Path]) -> None:
    """Refuse to replace files that no mount has written, or that have changed since.

    Args:
        target: The model's file, for the message.
        files: Files that are there.

    Raises:
        InputError: One of them may not be replaced.
        OSError: It cannot be read.
    """
    theirs = [file for file in files if not is_as_written(file)]
    if theirs:
        are = "is" if len(theirs) == 1 else "are"
        raise InputError(
            f"-o {target}: {listed([str(file) for file in theirs])} {are} there, not as cmg-mj mount wrote it, and "
            "would be lost: move it, or give another name"
        )


def _lock_file(folder: Path, stem: str) -> Path:
    return folder / f".{stem.lstrip('.')}.mount.lock"


def _clear_left_over(folder: Path) -> None:
    """Take away what mounts began to write in a folder and did not end, if their processes have ended.

    A mount holds the lock of its target, which dies with it. Where files cannot be locked, its process' number tells.
    """
    matches = [(match, folder / match[0]) for name in os.listdir(folder) if (match := _PARTIAL.fullmatch(name))]
    for match, path in matches:
        with suppress(Busy, OSError):
            lock = Lock(_lock_file(folder, match["stem"]))
            try:
                if not _is_alive(int(match["process"])) and is_begun(path):
                    path.unlink()
            finally:
                lock.release()


def _is_alive(process: int) -> bool:
    """Return whether a process of this number may be running; on Windows, where a look would end it, the lock tells."""
    if sys.platform == "win32":
        return False
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
