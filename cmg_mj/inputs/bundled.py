"""Paths of the bundled models and scenarios."""

from __future__ import annotations

from pathlib import Path

from cmg_mj.errors import InputError, nearest
from cmg_mj.inputs.sanity import is_text

_PACKAGE = Path(__file__).resolve().parents[1]


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
        candidates.append(folder(kind) / (name if name.endswith(suffix) else name + suffix))
    if beside is not None:
        candidates = [beside / name, *candidates[1:], Path(name)]
    try:
        for path in candidates:
            if path.is_file():
                if kind == "models" and not is_text(str(path.resolve())):  # which a scenario names in UTF-8
                    raise InputError(f"{field} {name!r}: lies in a folder whose name is not UTF-8 text")
                return path
        if name and any(path.is_dir() for path in candidates):
            raise InputError(f"{field} {name!r}: is a folder, not a file")
        if name and any(path.exists() for path in candidates):
            raise InputError(f"{field} {name!r}: is no ordinary file")
    except OSError as error:  # a name that is too long, a folder that may not be looked into
        raise InputError(f"{field} {name!r}: cannot be read: {error.strerror}") from error
    known = nearest(Path(name).name.removesuffix(suffix), bundled(kind), "bundled")
    raise InputError(f"{field} {name!r}: no such file, nor a bundled one; {known}")
