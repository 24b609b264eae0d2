"""The folder of a result and its files: written to a hidden sibling and renamed into their place whole."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmg_mj.core.errors import InputError, raised

if TYPE_CHECKING:
    import pyarrow as pa

Writers = Mapping[str, Callable[[Path], object]]
"""Name of a file -> function that writes it to the path given."""

MARKER = ".cmg_mj"
"""File in a result's folder: `complete` or `incomplete`, then the names of the files that cmg_mj wrote, a line each."""
REQUESTS = ("scenario.toml", "replay.toml", "study.toml")
"""Files that say what was asked for: another result is not replaced without being asked to."""


class RunFolder:
    """A place for one result.

    Attributes:
        path: The folder that was asked for. If something else is there, the result goes to `NAME-2` and so on.
        part: The hidden folder beside it, in which the result is written.
    """

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        """Prepare a place, and finish or remove what killed runs have left there.

        Args:
            path: The folder.
            overwrite: Whether the result of another request is replaced, if cmg_mj wrote all that is there.

        Raises:
            InputError: Nothing can be written there.
        """
        self.path = path
        self._overwrite = overwrite
        try:
            self._folder = folder = Path(os.path.abspath(path))  # a user's code may change the current folder
            self._made = [parent for parent in folder.parents if not parent.exists()]
            if folder in (Path.cwd(), *Path.cwd().parents):
                raise OSError(0, "is the current folder, or holds it; name another folder")
            if os.path.lexists(folder) and not folder.is_dir():
                raise OSError(0, "is no folder")
            self.part = _hidden(folder, "part")
            folder.parent.mkdir(parents=True, exist_ok=True)
            recover(folder)
            self.part.mkdir()
        except OSError as error:
            raise InputError(f"--out {path}: cannot be written: {error.strerror}") from error

    def write(self, files: Writers, *, complete: bool = True, all_or_none: bool = False) -> Path:
        """Write a result: every file that can be written, and then complain of those that cannot.

        Args:
            files: The files.
            complete: Whether the run came to its end. An incomplete result never replaces a complete one.
            all_or_none: Whether nothing is kept when a file cannot be written.

        Returns:
            The result's folder.

        Raises:
            InputError: A file cannot be written. The others are, unless it is all or none.
        """
        wrong: dict[str, str] = {}
        written: list[str] = []
        place = self.path
        try:
            for name, write in files.items():
                try:
                    write(self.part / name)
                    written.append(name)
                except Exception as error:  # such as a title that no file can hold
                    wrong[name] = getattr(error, "strerror", None) or raised(error)
        finally:  # also on Ctrl-C, for the second time
            for path in self.part.iterdir():
                if path.name not in written:
                    path.unlink()
            if written and not (wrong and all_or_none):
                complete = complete and len(written) == len(files)
                try:
                    write_marker(self.part, written, complete=complete)
                    place = next(place for place in numbered(self._folder) if self._takes(place, complete))
                except OSError as error:
                    raise InputError(f"{self.path}: cannot be written: {error.strerror}") from error
                place = self.path if place == self._folder else self.path.with_name(place.name)
        if wrong:
            raise InputError("; ".join(f"{place / name}: cannot be written: {why}" for name, why in wrong.items()))
        return place

    def _takes(self, place: Path, complete: bool) -> bool:
        """Rename the written folder into a place, unless what is there stays."""
        old = _hidden(place, "old")
        with suppress(OSError):
            place.rmdir()  # if it is empty
        if os.path.lexists(place):
            asked = self._overwrite or all(_text(place / name) == _text(self.part / name) for name in REQUESTS)
            if not asked or not is_own(place) or (is_complete(place) and not complete):
                return False
            place.rename(old)
        try:
            self.part.rename(place)
        except OSError:
            if os.path.lexists(place):  # another run has just come here
                return False
            if old.exists():
                old.rename(place)
            raise
        shutil.rmtree(old, ignore_errors=True)
        return True

    def release(self, *_: object) -> None:
        """Remove what was made for nothing."""
        shutil.rmtree(self.part, ignore_errors=True)
        with suppress(OSError):  # what holds something stays
            for parent in self._made:
                parent.rmdir()

    def __enter__(self) -> RunFolder:
        return self

    __exit__ = release


def claimed(folder: RunFolder | Path) -> RunFolder:
    """Prepare a folder, unless it is prepared already."""
    return folder if isinstance(folder, RunFolder) else RunFolder(folder)


def numbered(folder: Path) -> Iterator[Path]:
    """Yield NAME, NAME-2, NAME-3 and so on."""
    yield folder
    if folder.name in ("", ".."):
        folder = Path(os.path.abspath(folder))
    for number in itertools.count(2):
        yield Path(f"{folder}-{number}")


def write_marker(folder: Path, names: Iterable[str], *, complete: bool) -> None:
    """Write the list of the files that cmg_mj writes into a folder; a name may begin with a folder in it."""
    lines = ["complete" if complete else "incomplete", *names]
    (folder / MARKER).write_text("\n".join(lines), encoding="utf-8", errors="surrogateescape")


def _marker(folder: Path) -> tuple[str, list[Path]]:
    """Read whether a folder's result is complete, and its files; an empty word where there is no marker."""
    state, *names = (_text(folder / MARKER) or "").split("\n")
    return state, [folder / name for name in names]


def is_complete(folder: Path) -> bool:
    """Return whether a folder holds a complete result, and all of it still there."""
    state, files = _marker(folder)
    return state == "complete" and all(file.is_file() for file in files)


def is_own(folder: Path) -> bool:
    """Return whether cmg_mj wrote everything in a folder."""
    state, files = _marker(folder)
    known = {folder / MARKER, *files, *(parent for file in files for parent in file.parents)}
    return (
        state in ("complete", "incomplete")
        and not folder.is_symlink()
        and all(path in known and not path.is_symlink() for path in folder.rglob("*"))
    )


def recover(folder: Path) -> None:
    """Put back what a killed process moved out of a folder's place, and remove what it left beside it."""
    for path in folder.parent.iterdir():
        left = re.fullmatch(rf"\.({re.escape(folder.name)}(?:-\d+)?)\.(\d{{1,9}})-\d+\.(part|old)", path.name)
        if not left or path.is_symlink() or _is_alive(int(left[2])):
            continue
        place, (_, files) = folder.with_name(left[1]), _marker(path)
        if left[3] == "old" and files and all(file.is_file() for file in files) and not os.path.lexists(place):
            path.rename(place)
        else:
            shutil.rmtree(path, ignore_errors=True)


def _hidden(folder: Path, ending: str) -> Path:
    return folder.with_name(f".{folder.name}.{os.getpid()}-{time.time_ns()}.{ending}")


def _is_alive(process: int) -> bool:
    """Return whether a process of this number may be running; on Windows, a look would end it."""
    if sys.platform == "win32":
        return True
    try:
        os.kill(process, 0)
    except OSError as error:
        return isinstance(error, PermissionError)
    return True


def _text(path: Path) -> str | None:
    """Read a text file; None where there is none."""
    try:
        return path.read_text(encoding="utf-8", errors="surrogateescape") if path.is_file() else None
    except OSError:
        return None


def write_text(path: Path, text: str) -> None:
    """Write a text file that ends in one line's end."""
    path.write_text(text.rstrip("\n") + "\n", encoding="utf-8")


SIGNATURES = {
    ".xml": "<!-- Written by cmg-mj mount, which may replace this file -->\n",
    ".toml": "# Written by cmg-mj mount, which may replace this file\n",
}
"""Ending of a file that stands alone -> its first line."""


def signed(text: str, ending: str) -> bytes:
    """Put the line above a text that says who wrote it."""
    return (SIGNATURES[ending] + text).encode()


def is_signed(path: Path) -> bool:
    """Return whether a file begins with the line that `signed` puts there."""
    if not path.is_file() or path.is_symlink():
        return False
    line = signed("", path.suffix)
    with path.open("rb") as file:
        return file.read(len(line)) == line


METADATA_KEY = b"cmg_mj"
"""The key of what cmg_mj says of a table, as JSON, in the metadata of its Parquet file."""
ROW_GROUP = 32768
"""Number of rows that Arrow compresses together, and that a reader may skip."""


@contextmanager
def whole_file(path: Path, ending: str = "") -> Iterator[Path]:
    """Give a temporary name to write to; rename it to `path` at the end, or remove it if the writing failed.

    Args:
        path: The file.
        ending: Ending of the temporary name, for readers that go by it.

    Yields:
        The temporary file.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.partial{ending}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_parquet(path: Path, table: pa.Table, metadata: Mapping[str, Any]) -> None:
    """Write a table as Parquet, whole or not at all.

    Args:
        path: The file.
        table: The table.
        metadata: What the file says of the table beside it.
    """
    import pyarrow.parquet as pq

    # Opened here: Arrow takes no path with bytes that are no UTF-8.
    with whole_file(path) as temporary, temporary.open("wb") as file:
        stored = {METADATA_KEY: json.dumps(metadata).encode()}
        pq.write_table(table.replace_schema_metadata(stored), file, row_group_size=ROW_GROUP)
