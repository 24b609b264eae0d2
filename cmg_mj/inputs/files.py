"""Files that users name: bundled ones, paths with `~`, texts of limited size, models that include others."""

from __future__ import annotations

import html
import itertools
import math
import re
import tomllib
from pathlib import Path
from typing import Any

from cmg_mj.core.errors import InputError, nearest

_PACKAGE = Path(__file__).resolve().parents[1]
_TAG = re.compile(
    r"""<(?:!--.*?(?:-->|\Z)|!\[CDATA\[.*?(?:\]\]>|\Z)|[!?][^>]*>|"""
    r"""(/?)([^\s<>"'/]+)((?:[^<>"']++|"[^"]*"|'[^']*')*+)>)""",
    re.DOTALL,
)
"""A tag, or what may hold some that are none. No parser of XML is so lenient as MuJoCo's."""
_ATTRIBUTE = re.compile(r"""([^\s=<>"']+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
MAX_MODEL_BYTES = 50_000_000
MAX_TOML_BYTES = 10_000_000
"""A scenario or study is smaller; the longest scenario that a run writes has three thousand bytes."""
MAX_COPIES = 20_000
"""Most elements that <replicate> and the like make in all; MuJoCo takes up to a minute for so many bodies."""
FREE_COUNTS = 15
"""As how many copies a free body or a point of a flex counts: their equations of motion are one full matrix."""
FOLDERS = "meshdir", "texturedir", "assetdir"


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
        raise InputError(f"{name}: not UTF-8 text (at byte {error.start}); save it as UTF-8") from error
    except OSError as error:
        raise InputError(f"{name}: cannot be read: {error.strerror}") from error


def model_files(path: Path) -> list[Path]:
    """List a model's file and those that it includes or attaches, as far as they are there.

    Raises:
        InputError: What would crash MuJoCo or keep it busy for ever: a file that includes itself, too many copies,
            an asset that is no ordinary file. Or a file cannot be read.
    """
    files: list[Path] = []
    folders, names, total = {""}, set[str](), 0.0

    def read(file: Path, within: tuple[Path, ...], copies: float) -> None:
        nonlocal total
        if file.resolve() in (outer.resolve() for outer in within):
            raise InputError(f"{path}: contains itself: {' in '.join(each.name for each in (*within, file))}")
        name = f"{path}: {file.name}" if within else str(path)
        text = read_text(file, name, MAX_MODEL_BYTES)
        within, stack, inner, attached = (*within, file), [copies], list[tuple[str, float]](), 0.0
        for end, tag, rest in _TAG.findall(text):
            if end:
                stack[1:] = stack[1:-1]
            if end or not tag:
                continue
            # Of an attribute given twice MuJoCo takes the first.
            attributes = {key: html.unescape(a or b) for key, a, b in reversed(_ATTRIBUTE.findall(rest))}
            made = stack[-1] * max(1.0, math.prod(map(float, re.findall(r"[+-]?\d+", attributes.get("count", "")))))
            moves = tag in ("freejoint", "flexcomp") or attributes.get("type") == "free"
            total += made * (made > 1.0) * (FREE_COUNTS if moves else 1)
            attached += made * (tag == "attach")
            if total > MAX_COPIES:
                raise InputError(
                    f"{name}: <{tag}>: makes {made:.3g} copies; at most {MAX_COPIES:,} are read in all, of free bodies "
                    f"and points of a flex {MAX_COPIES // FREE_COUNTS:,}"
                )
            folders.update(attributes[key] for key in FOLDERS if key in attributes)
            names.update(value for key, value in attributes.items() if key.startswith("file"))
            if tag in ("include", "model") and "file" in attributes:
                inner.append((attributes["file"], made if tag == "include" else 0.0))
            if not rest.endswith("/"):
                stack.append(made)
        files.append(file)
        for included, times in inner:
            places = (file.parent / included, path.parent / included)
            for place in [place for place in places if place.is_file()][:1]:
                read(place, within, times or max(copies, attached))

    read(path, (), 1.0)
    for base, below, asset in itertools.product({file.parent for file in files}, folders, names):
        for place in (base / below / asset.removeprefix("package://"), base / below / Path(asset).name):
            if place.exists() and not (place.is_file() or place.is_dir()):
                raise InputError(f"{path}: {asset}: is no ordinary file")
    return files


def whole_path(file: str, beside: Path) -> str:
    """Return the whole path of a file, which may start from a folder; one that is nowhere keeps its name."""
    return next((str(path.resolve()) for path in (beside / file, Path(file)) if path.is_file()), file)
