"""Paths that users name: `~`, and what is there."""

from __future__ import annotations

from pathlib import Path

from cmg_mj.errors import InputError, shown
from cmg_mj.inputs.sanity import is_text


def expanded(path: str | Path, option: str) -> Path:
    """Put the home folder in the place of `~`, or somebody's in that of `~name`.

    Args:
        path: The path as the user wrote it.
        option: The option that names it, for the message.

    Returns:
        The path.

    Raises:
        InputError: There is no such user, or no home folder.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise InputError(f"{option} {path}: no home folder is known of {Path(path).parts[0]}") from error


def require_file(path: Path) -> None:
    """Refuse a path that names no ordinary file.

    Raises:
        InputError: The path names no ordinary file.
    """
    name = path if is_text(str(path)) else shown(str(path))
    try:
        if path.is_file():
            if not is_text(str(path.resolve())):  # MuJoCo opens no such file
                raise InputError(f"{name}: {not_text(path, path.resolve())}")
            return
        what = "is a folder" if path.is_dir() else "is no ordinary file" if path.exists() else "no such file"
    except OSError as error:  # a name that is too long, a folder that may not be looked into
        what = f"cannot be read: {error.strerror}"
    raise InputError(f"{name}: {what}")


def not_text(path: Path, whole: Path) -> str:
    """Say which part of a path is not UTF-8 text, though it must be.

    Args:
        path: The path as the user wrote it.
        whole: The whole path, with a part that is not UTF-8 text.

    Returns:
        The clause.
    """
    why = "is not UTF-8 text, and MuJoCo opens no such file"
    if not is_text(path.name):
        return f"the file's name {why}"
    part = next((part for part in reversed(whole.parts[:-1]) if not is_text(part)), None)
    return f"the file's name {why}" if part is None else f"the name of the folder {shown(part)} in its path {why}"
