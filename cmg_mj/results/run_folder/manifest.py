"""The list of files that cmg_mj has written into a folder: it deletes and overwrites no others there."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

HIDDEN = ".cmg-mj"
"""Folder of cmg_mj's own files in a run folder: the manifest; during a run also its lock and the unfinished result."""


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
        """The files there are in a folder."""
        return Manifest({path.name: _digest(path) for path in sorted(folder.iterdir()) if path.is_file()}, complete)

    @staticmethod
    def read(folder: Path) -> Manifest:
        """A folder's manifest; empty where there is none: then nothing there is known to be cmg_mj's."""
        try:
            stored = json.loads((folder / HIDDEN / "files.json").read_text(encoding="utf-8"))
            return Manifest(dict(stored["files"]), bool(stored["complete"]))
        except (OSError, ValueError, LookupError, TypeError):
            return Manifest()

    def write(self, folder: Path) -> None:
        """Write it into a folder that has none yet."""
        stored = {"written_by": f"cmg_mj {version('cmg_mj')}", "complete": self.complete, "files": self.files}
        (folder / HIDDEN / "files.json").write_text(json.dumps(stored, indent=2) + "\n", encoding="utf-8")

    def has(self, path: Path) -> bool:
        """Return whether a file is as cmg_mj has written it."""
        try:
            return not path.is_symlink() and path.is_file() and self.files.get(path.name) == _digest(path)
        except OSError:
            return False

    def stands(self, folder: Path) -> bool:
        """Return whether this is a complete result, and all of it still there."""
        return self.complete and all((folder / name).is_file() for name in self.files)


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
    (folder / HIDDEN / "files.json").unlink(missing_ok=True)
    for empty in (folder / HIDDEN, folder):
        try:
            empty.rmdir()
        except OSError:  # what holds something stays
            return


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
