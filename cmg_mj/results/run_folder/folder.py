"""A run folder, claimed from before a run until its result is in it."""

from __future__ import annotations

import itertools
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

from cmg_mj.errors import InputError, raised
from cmg_mj.results.memory import release_free_memory
from cmg_mj.results.run_folder.lock import Busy, Lock
from cmg_mj.results.run_folder.manifest import HIDDEN, Manifest, require_own, users_files
from cmg_mj.results.run_folder.swap import ASIDE, recover, stage, swap_in
from cmg_mj.results.run_folder.written_names import foreign_names

Writers = Mapping[str, Callable[[Path], None]]
"""Name of a file -> what writes it to the path given."""


class FolderInUse(InputError):
    """A folder that is there, but not for this run: another writes to it, or a user's file would be written over."""


class RunFolder:
    """A folder that one run writes to, and meanwhile no other.

    What a user has in it stays as it is. What cmg_mj has written there before is replaced whole, when the new result is
    whole.

    Attributes:
        path: The folder, as the user named it.
    """

    def __init__(self, path: Path, names: Iterable[str] = ()) -> None:
        """Claim the folder, make it if need be, and take away what killed runs have left there.

        Args:
            path: The folder.
            names: What will be written, as far as it is known.

        Raises:
            FolderInUse: Another run writes to it, one of the names is that of a file that cmg_mj has not written, or
                what is there under cmg_mj's own names is somebody else's.
            InputError: It cannot be made or written.
        """
        self.path = path
        self._lock: Lock | None = None
        self._made: list[Path] = []
        try:
            self._made = [folder for folder in (path, *path.parents) if not folder.exists()]
            path.mkdir(parents=True, exist_ok=True)
            self._folder = path.resolve()
            require_own(self._folder)  # before the lock, which is a file in it
            self._lock = Lock(self._folder / HIDDEN / "lock")
            recover(self._folder, self._lock)
            theirs = sorted(set(users_files(self._folder)) & set(names))
        except Busy:
            self.release()
            raise FolderInUse(f"--out {path}: another run is writing to it") from None
        except OSError as error:
            self.release()
            raise InputError(f"--out {path}: cannot be written: {error.strerror}") from error
        except InputError as error:
            self.release()
            raise FolderInUse(f"--out {path}: {error}") from None
        except BaseException:
            self.release()
            raise
        if theirs:
            self.release()
            are = "is" if len(theirs) == 1 else "are"
            raise FolderInUse(
                f"--out {path}: {', '.join(theirs)} there {are} not as cmg-mj wrote it, and would be lost: move it, or "
                "name another folder"
            )

    def write(self, files: Writers, *, complete: bool = True, all_or_none: bool = False) -> Path:
        """Write a result: every file that can be written, and then complain of those that cannot.

        Args:
            files: What to write.
            complete: Whether the run came to its end.
            all_or_none: Whether nothing is kept when a file cannot be written.

        Returns:
            Where it is: the folder; or one in it, if this result is not complete and that in the folder is, or if a
            user's file would be written over.

        Raises:
            InputError: A file cannot be written. The others are, unless it is all or none.
        """
        assert not foreign_names(files), f"not in written_names.py: {foreign_names(files)}"
        wrong: dict[str, BaseException] = {}
        try:
            new = stage(self._folder)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be written: {error.strerror}") from error
        for name, write in files.items():
            try:
                release_free_memory()  # of the file before: together, those of a long result would take a lot
                write(new / name)
            except BaseException as error:  # such as a title that no file can hold
                (new / name).unlink(missing_ok=True)
                wrong[name] = error
                if not isinstance(error, Exception):  # Ctrl-C, for the second time
                    break
        if wrong and all_or_none:
            shutil.rmtree(new, ignore_errors=True)
            place = self.path
        else:
            place = self._place(new, complete=complete and not wrong)  # what is done is kept
        for error in wrong.values():
            if not isinstance(error, Exception):
                raise error
        if wrong:
            raise InputError("; ".join(_complaint(place / name, error) for name, error in wrong.items()))
        return place

    def _place(self, new: Path, *, complete: bool) -> Path:
        """Have what was written take its place."""
        manifest = Manifest.of(new, complete)
        try:
            if not manifest.files:
                return self.path
            manifest.write(new)
            if self._has_room_for(manifest):
                assert self._lock is not None
                swap_in(new, self._folder, self._lock)
                return self.path
            return self._set_aside(new, manifest)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be written: {error.strerror or error}") from error
        finally:
            shutil.rmtree(new, ignore_errors=True)  # unless it has been moved to its place

    def _has_room_for(self, manifest: Manifest) -> bool:
        """Return whether writing loses nothing: no complete result for an incomplete one, no file of the user's."""
        loses = not manifest.complete and Manifest.read(self._folder).stands(self._folder)
        return not loses and not set(manifest.files) & set(users_files(self._folder))

    def _set_aside(self, new: Path, manifest: Manifest) -> Path:
        """Put what may not take the folder's place into a folder in it."""
        for number in itertools.count(1):
            name = ASIDE if number == 1 else f"{ASIDE}-{number}"
            if (self.path / name).is_symlink():  # out of the folder
                continue
            with suppress(FolderInUse), RunFolder(self.path / name) as aside:
                if aside._has_room_for(manifest):
                    assert aside._lock is not None
                    swap_in(new, aside._folder, aside._lock)
                    return aside.path
        raise AssertionError("count() does not end")

    def release(self) -> None:
        """Let others have it. A folder that was made for nothing is taken away."""
        if self._lock is not None:
            with suppress(OSError):
                self._lock.release()
            self._lock = None
        with suppress(OSError):  # what holds something stays
            for folder in (self.path / HIDDEN, *self._made):
                if folder.exists():
                    folder.rmdir()

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(self, *exception: object) -> None:
        self.release()


def _complaint(path: Path, error: BaseException) -> str:
    return f"{path}: cannot be written: {getattr(error, 'strerror', None) or raised(error)}"


@contextmanager
def claimed(folder: RunFolder | Path, names: Iterable[str] = ()) -> Iterator[RunFolder]:
    """Enter a folder that may have been claimed already; if not, claim it for files of these names."""
    with nullcontext(folder) if isinstance(folder, RunFolder) else RunFolder(folder, names) as claim:
        yield claim


def write_text(path: Path, text: str) -> None:
    """Write a text file that ends in one line's end."""
    path.write_text(text.rstrip("\n") + "\n", encoding="utf-8")


def unused_folder(parent: Path, name: str, names: Iterable[str], request_toml: str, request_file: str) -> RunFolder:
    """Claim a folder that no other run has written: the name itself, or with a number behind it.

    The same run again goes to the same folder.

    Args:
        parent: Where the folders are.
        name: The name wanted.
        names: What will be written.
        request_toml: What is asked for, as the folder will say it.
        request_file: The file that says it.

    Returns:
        The folder.

    Raises:
        InputError: It cannot be made or written.
    """
    for number in itertools.count(1):
        folder = parent / (name if number == 1 else f"{name}-{number}")
        if not os.path.lexists(folder) or _is_unused(folder) or _is_of(folder / request_file, request_toml):
            with suppress(FolderInUse):
                return RunFolder(folder, names)
    raise AssertionError("count() does not end")


def _is_unused(folder: Path) -> bool:
    """Return whether a folder is empty, except for the remains of a killed run."""
    return folder.is_dir() and all(path.name == HIDDEN for path in folder.iterdir())


def _is_of(path: Path, request_toml: str) -> bool:
    """Return whether cmg_mj wrote this file, and the file makes the same request."""
    try:
        return Manifest.read(path.parent).has(path) and path.read_text(encoding="utf-8") == request_toml
    except (OSError, ValueError):  # or somebody else's list of files
        return False
