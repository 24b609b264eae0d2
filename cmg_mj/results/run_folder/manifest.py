"""The list of files that cmg_mj has written into a folder: it deletes and overwrites no others there."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

from cmg_mj.errors import InputError, shown
from cmg_mj.results.files import is_plain_file
from cmg_mj.results.run_folder.written_names import foreign_names

HIDDEN = ".cmg-mj"
"""Folder of cmg_mj's own files in a run folder: the manifest; during a run also its lock and the unfinished result."""

FILES = "files.json"
"""The manifest's file in `HIDDEN`."""
REMOVE = f"remove {HIDDEN}, or name another folder"
LARGEST_MANIFEST = 4_000_000
"""A manifest of more bytes is not cmg_mj's."""

MADE = {"": ("new", "ready"), "new": (HIDDEN,), "ready": (HIDDEN,), f"new/{HIDDEN}": (), f"ready/{HIDDEN}": ()}
"""Folder in `HIDDEN` -> the folders that cmg_mj makes in it."""


@dataclass(frozen=True)
class Manifest:
    """The files of a result.

    Attributes:
        files: Name -> SHA-256 of what was written. A file that has changed since is the user's.
        complete: Whether the run came to its end and everything was written.
    """

    files: dict[str, str] = field(default_factory=dict)
    complete: bool = False

    @staticmethod
    def of(folder: Path, complete: bool) -> Manifest:
        """Return the files of a folder."""
        return Manifest({path.name: _digest(path) for path in sorted(folder.iterdir()) if path.is_file()}, complete)

    @staticmethod
    def read(folder: Path) -> Manifest:
        """Read a folder's manifest; empty where there is none: then nothing there is known to be cmg_mj's.

        Raises:
            InputError: The manifest names a file that cmg_mj never writes, or gives one no SHA-256. Somebody else has
                written it.
        """
        path = folder / HIDDEN / FILES
        try:
            if not is_plain_file(path) or path.stat().st_size > LARGEST_MANIFEST:
                return Manifest()
            stored = json.loads(path.read_text(encoding="utf-8"))
            files, complete = dict(stored["files"].items()), bool(stored["complete"])
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
            return Manifest()
        for name in foreign_names(files):
            raise InputError(f"{HIDDEN} there names {shown(name)}, which cmg-mj never writes: {REMOVE}")
        for name, digest in files.items():
            if not isinstance(digest, str) or not re.fullmatch("[0-9a-f]{64}", digest):
                raise InputError(f"{HIDDEN} there gives {shown(digest)} as the SHA-256 of {shown(name)}: {REMOVE}")
        return Manifest(files, complete)

    def write(self, folder: Path) -> None:
        """Write it into a folder that has none yet."""
        stored = {"written_by": f"cmg_mj {version('cmg_mj')}", "complete": self.complete, "files": self.files}
        (folder / HIDDEN / FILES).write_text(json.dumps(stored, indent=2) + "\n", encoding="utf-8")

    def has(self, path: Path) -> bool:
        """Return whether a file is as cmg_mj has written it."""
        try:
            return is_plain_file(path) and self.files.get(path.name) == _digest(path)
        except OSError:
            return False

    def stands(self, folder: Path) -> bool:
        """Return whether this is a complete result, and all of it still there."""
        return self.complete and all((folder / name).is_file() for name in self.files)


def require_own(folder: Path) -> None:
    """Refuse a `.cmg-mj` that cmg_mj has not made: a link in the place of a folder or file leads out of the folder.

    Raises:
        InputError: Something there is of another kind than what cmg_mj makes.
    """
    hidden = folder / HIDDEN
    for path in (hidden, hidden / "new", hidden / "new" / HIDDEN, hidden / "ready", hidden / "ready" / HIDDEN):
        if path.is_symlink() or (path.exists() and not path.is_dir()):
            raise InputError(f"{path.relative_to(folder)} there is no folder that cmg-mj makes: {REMOVE}")
    for parent, names in MADE.items():
        for path in sorted((hidden / parent).glob("*")):
            if path.is_dir() and path.name not in names:
                raise InputError(f"{path.relative_to(folder)} there is no folder that cmg-mj makes: {REMOVE}")
    for path in (hidden / "lock", hidden / FILES, hidden / "ready" / HIDDEN / FILES):
        if path.is_symlink() or (path.exists() and not is_plain_file(path)):
            raise InputError(f"{path.relative_to(folder)} there is no file that cmg-mj writes: {REMOVE}")


def users_files(folder: Path) -> list[str]:
    """Names of all in a folder that is not as cmg_mj has written it."""
    manifest = Manifest.read(folder)
    return [path.name for path in sorted(folder.iterdir()) if path.name != HIDDEN and not manifest.has(path)]


def remove_result(folder: Path) -> None:
    """Take away what cmg_mj has written into a folder, and the folder itself if nothing else is in it."""
    manifest = Manifest.read(folder)
    for name in manifest.files:
        if manifest.has(folder / name):
            (folder / name).unlink()
    (folder / HIDDEN / FILES).unlink(missing_ok=True)
    for empty in (folder / HIDDEN, folder):
        try:
            empty.rmdir()
        except OSError:  # what holds something stays
            return


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
