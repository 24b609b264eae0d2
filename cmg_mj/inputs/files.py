"""Files that users name: bundled ones, paths with `~`, texts of limited size, models that include others."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from cmg_mj.core.errors import InputError, nearest

_PACKAGE = Path(__file__).resolve().parents[1]
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_INCLUDED = re.compile(r"""<(?:include|model)\b[^<>]*?\bfile\s*=\s*["']([^"']*)["']""")
MAX_MODEL_BYTES = 50_000_000
MAX_TOML_BYTES = 10_000_000
"""A scenario or study is smaller; the longest scenario that a run writes has three thousand bytes."""


def folder(name: str) -> Path:
    """Return the bundled folder `models`, `scenarios` or `examples`: in the wheel, or beside the package in a clone."""
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def bundled(name: str) -> list[str]:
    """Names of the bundled files of a folder, without their endings."""
    return sorted(path.stem for path in folder(name).iterdir() if path.suffix in (".xml", ".toml"))


def find(kind: str, name: str, suffix: str, field: str, beside: Path | None = None) -> Path:
    """Find a file that the user names by path or, if it is bundled, by name.

    Args:
        kind: The bundled folder.
        name: What the user wrote.
        suffix: The file's ending, which a bundled name may leave out.
        field: What to call it in the error.
        beside: A folder that relative paths start from first. The current folder then comes last, so that the same
            file is found wherever one stands.

    Returns:
        The file's path.

    Raises:
        InputError: There is no such file.
    """
    candidates = [Path(name)]
    if "/" not in name and "\\" not in name:
        candidates.append(folder(kind) / (name.removesuffix(suffix) + suffix))
    if beside is not None:
        candidates = [beside / name, *candidates[1:], Path(name)]
    for path in candidates:
        if _is_file(path, f"{field} {name!r}"):
            return path
    if name and any(path.exists() for path in candidates):
        raise InputError(f"{field} {name!r}: is no ordinary file")
    known = nearest(Path(name).name.removesuffix(suffix), bundled(kind), "bundled")
    raise InputError(f"{field} {name!r}: no such file, nor a bundled one; {known}")


def _is_file(path: Path, name: str) -> bool:
    try:
        return path.is_file()
    except OSError as error:  # a name that is too long, a folder that may not be looked into
        raise InputError(f"{name}: cannot be read: {error.strerror}") from error


def require_file(path: Path) -> None:
    """Check that a path names an ordinary file.

    Raises:
        InputError: The path names no ordinary file.
    """
    if not _is_file(path, str(path)):
        raise InputError(f"{path}: {'is no ordinary file' if path.exists() else 'no such file'}")


def expanded(path: str | Path, option: str) -> Path:
    """Put the home folder in the place of `~`, or somebody's in that of `~name`.

    Args:
        path: The path as the user wrote it.
        option: The option that names it, for the message.

    Raises:
        InputError: There is no such user, or no home folder.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise InputError(f"{option} {path}: no home folder is known of {Path(path).parts[0]}") from error


def read_toml(path: Path, name: str) -> dict[str, Any]:
    """Read the content of a TOML file that a user names.

    Args:
        path: The file.
        name: What to call it in messages.

    Raises:
        InputError: The file is no TOML, or cannot be read.
    """
    text = read_text(path, name, MAX_TOML_BYTES)
    if text.lstrip().startswith("<"):
        raise InputError(f"{name}: is XML, not a scenario; a scenario names its model with plant.model")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise InputError(f"{name}: not valid TOML: brackets in too many brackets") from error
    except ValueError as error:  # a TOMLDecodeError, or a number of too many digits
        raise InputError(f"{name}: not valid TOML: {error}") from error


def read_text(path: Path, name: str, max_bytes: int) -> str:
    """Read an ordinary text file that a user names, with or without a byte order mark.

    Args:
        path: The file.
        name: What to call it in messages.
        max_bytes: The largest size that such a file has.

    Raises:
        InputError: The file is larger, is no ordinary file or no UTF-8 text, or cannot be read.
    """
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"{name}: is no ordinary file")
        if path.stat().st_size > max_bytes:
            raise InputError(f"{name}: larger than {max_bytes // 1_000_000} MB")
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: not UTF-8 text (at byte {error.start})") from error
    except OSError as error:
        raise InputError(f"{name}: cannot be read: {error.strerror}") from error


def model_files(path: Path, within: tuple[Path, ...] = ()) -> list[Path]:
    """List a model's file and those that it includes or attaches, as far as they are there.

    Raises:
        InputError: A file includes itself, which crashes MuJoCo, or cannot be read.
    """
    if path.resolve() in (file.resolve() for file in within):
        raise InputError(f"{within[0]}: contains itself: {' in '.join(file.name for file in (*within, path))}")
    within, files = (*within, path), [path]
    name = str(path) if len(within) == 1 else f"{within[0]}: {path.name}"
    for included in _INCLUDED.findall(_COMMENT.sub("", read_text(path, name, MAX_MODEL_BYTES))):
        places = (path.parent / included, within[0].parent / included)
        files += next((model_files(place, within) for place in places if place.is_file()), [])
    return files


def whole_path(file: str, beside: Path) -> str:
    """Return the whole path of a file, which may start from a folder; one that is nowhere keeps its name."""
    return next((str(path.resolve()) for path in (beside / file, Path(file)) if path.is_file()), file)
