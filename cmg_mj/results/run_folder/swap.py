"""A new result takes the place of the old one in its folder, whole.

The new result is written to `.cmg-mj/new` in the folder. Then the user's files are linked into it, it becomes a folder
beside the one it replaces, and the two change names: one system call, before which there is the old result and after
which there is the new one. Where that cannot be done, `.cmg-mj/new` is renamed to `.cmg-mj/ready`, from when on it
counts, and its files are moved one by one; if that is interrupted, `recover` moves the rest.
"""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
import sys
from contextlib import suppress
from pathlib import Path

from cmg_mj.errors import InputError
from cmg_mj.results.files import is_plain_file
from cmg_mj.results.run_folder.lock import Busy, Lock
from cmg_mj.results.run_folder.manifest import (
    FILES,
    HIDDEN,
    Manifest,
    remove_result,
    require_own,
    users_files,
)

ASIDE = "incomplete"
"""Subfolder for a result that may not replace the one in the folder."""


def stage(folder: Path) -> Path:
    """Make the folder where a new result is written before it takes its place."""
    new = folder / HIDDEN / "new"
    (new / HIDDEN).mkdir(parents=True)
    return new


def swap_in(new: Path, folder: Path, lock: Lock) -> None:
    """Have a new result take the place of what cmg_mj has written into a folder before.

    Args:
        new: The result with its manifest, in a folder that `stage` has made, on the same disk.
        folder: Where to; nothing of the user's there has one of the result's names.
        lock: That of the folder.

    Raises:
        OSError: It cannot.
    """
    try:
        if not _swap_folders(new, folder, lock):
            new.rename(folder / HIDDEN / "ready")
            _move_in(folder)
    except BaseException:  # a full disk, or Ctrl-C: what has begun is finished
        recover(folder, lock)
        raise
    recover(folder, lock)


def recover(folder: Path, lock: Lock) -> None:
    """Finish or take away what a process that has ended left behind; `lock`, held, shows that it has ended.

    Raises:
        InputError: The list of the folder's files is not cmg_mj's.
    """
    beside = _beside(folder)
    if _is_left_over(beside, lock):
        _clear(beside, folder)
    if (folder / HIDDEN / "ready").is_dir():
        _move_in(folder)
    if (folder / HIDDEN / "new").is_dir():
        shutil.rmtree(folder / HIDDEN / "new")
    for aside in _asides(folder):
        with suppress(Busy, OSError):
            theirs = Lock(aside / HIDDEN / "lock")
            try:
                recover(aside, theirs)
            finally:
                theirs.release()


def _beside(folder: Path) -> Path:
    return folder.parent / f".{folder.name}{HIDDEN}"


def _asides(folder: Path) -> list[Path]:
    """List the folders in a folder where cmg_mj has set results aside."""
    return [path for path in folder.glob(f"{ASIDE}*") if (path / HIDDEN).is_dir() and _is_own(path)]


def _is_own(folder: Path) -> bool:
    """Return whether all that a folder in a run folder says of itself can be cmg_mj's; a link leads elsewhere."""
    try:
        require_own(folder)
        Manifest.read(folder)
    except InputError:
        return False
    return not folder.is_symlink()


def _superseded(folder: Path, by: Manifest) -> list[Path]:
    """List the results set aside that a complete result removes, without those being written now."""
    return [path for path in _asides(folder) if by.complete and not (path / HIDDEN / "lock").exists()]


def _is_left_over(beside: Path, lock: Lock) -> bool:
    """Return whether the folder is one that a run of this folder, now ended, had there while it swapped the two.

    Its lock is then the folder's own, by another name. A folder that only looks like it is somebody's.
    """
    if not beside.is_dir() or not _is_own(beside):
        return False
    hidden = beside / HIDDEN
    if list(beside.iterdir()) in ([], [hidden]) and not any(hidden.glob("*")):
        return True  # all but taken away
    return lock.is_the_file(hidden / "lock")


def _swap_folders(new: Path, folder: Path, lock: Lock) -> bool:
    """Swap whole folders; False, and nothing is changed, where that cannot be done."""
    going = [path.name for path in _superseded(folder, Manifest.read(new)) if not users_files(path)]
    user_files = [name for name in users_files(folder) if name not in going]
    if _stands_in(folder) or any((folder / name).is_dir() and not (folder / name).is_symlink() for name in user_files):
        return False
    beside = _beside(folder)
    try:
        os.link(lock.path, new / HIDDEN / "lock")
        for name in user_files:
            os.link(folder / name, new / name, follow_symlinks=False)
        shutil.copystat(folder, new)
        os.utime(new)
        if (new.stat().st_uid, new.stat().st_gid) != (folder.stat().st_uid, folder.stat().st_gid):
            return False
        new.rename(beside)
    except (OSError, NotImplementedError):  # no links on this disk, no place beside the folder
        return False
    try:
        _exchange(beside, folder)
    except OSError:  # a mount point, or the system cannot
        beside.rename(new)
        return False
    return True


def _stands_in(folder: Path) -> bool:
    """Return whether the current folder is this one or in it; a swap would leave its user in the old one."""
    try:
        here = Path.cwd().resolve()
    except OSError:  # it has been taken away
        return False
    return folder == here or folder in here.parents


def _exchange(one: Path, other: Path) -> None:
    """Have two folders change names, at once."""
    a, b = os.fsencode(one), os.fsencode(other)
    number = errno.ENOSYS
    with suppress(AttributeError, TypeError):  # a system, or a C library, that does not know of it
        libc = ctypes.CDLL(None, use_errno=True)
        if sys.platform == "darwin":
            failed = libc.renamex_np(a, b, 2)  # RENAME_SWAP
        else:
            failed = libc.renameat2(-100, a, -100, b, 2)  # AT_FDCWD, RENAME_EXCHANGE
        number = ctypes.get_errno() if failed else 0
    if number:
        raise OSError(number, os.strerror(number), str(other))


def _clear(old: Path, folder: Path) -> None:
    """Take away the folder whose place another has taken. What a user has put there meanwhile goes to the new one."""
    mine = Manifest.read(old)
    for path in sorted(old.iterdir()):
        there = folder / path.name
        if path.name == HIDDEN:
            continue
        if mine.has(path) or _is_link(path, there):
            path.unlink()
        elif path in _asides(old) and not users_files(path):
            remove_result(path)
        elif not os.path.lexists(there):
            path.rename(there)
        else:
            path.rename(_unused(there))
    for path in (old / HIDDEN).glob("*"):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        elif path.name != "lock":
            path.unlink()
    (old / HIDDEN / "lock").unlink(missing_ok=True)  # last: it shows that the folder is cmg_mj's
    shutil.rmtree(old / HIDDEN, ignore_errors=True)
    with suppress(OSError):  # if there is something again, it stays
        old.rmdir()


def _is_link(one: Path, other: Path) -> bool:
    try:
        return os.path.samestat(one.lstat(), other.lstat())
    except FileNotFoundError:
        return False


def _unused(path: Path) -> Path:
    """Return an unused name beside a file."""
    number = 1
    while os.path.lexists(path.with_name(f"{path.name}.{number}")):
        number += 1
    return path.with_name(f"{path.name}.{number}")


def _move_in(folder: Path) -> None:
    """Move the files of `.cmg-mj/ready` into their folder, as many as are still to be moved; its manifest last."""
    ready = folder / HIDDEN / "ready"
    if (ready / HIDDEN / FILES).exists():
        old, new = Manifest.read(folder), Manifest.read(ready)
        for name in old.files:
            if name not in new.files and old.has(folder / name):
                (folder / name).unlink()
        for name in new.files:
            free = not os.path.lexists(folder / name) or old.has(folder / name)
            if free and is_plain_file(ready / name):
                (ready / name).replace(folder / name)
        for aside in _superseded(folder, new):
            remove_result(aside)
        (ready / HIDDEN / FILES).replace(folder / HIDDEN / FILES)
    shutil.rmtree(ready)
