"""The folder that a run writes: which one, and what is written to it or goes from it."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from cmg_mj.errors import InputError, raised


def output_folder(path: Path) -> Path:
    """Make the folder a run writes to, and find out now whether it can be written.

    Args:
        path: The folder.

    Returns:
        The same.

    Raises:
        InputError: It cannot be made or written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=path).close()
    except OSError as error:
        raise InputError(f"--out {path}: cannot be written: {error.strerror}") from error
    return path


def unused_folder(parent: Path, name: str, scenario_toml: str) -> Path:
    """A folder that no other run has written: the name itself, or with a number behind it.

    The same run again goes to the same folder.

    Args:
        parent: Where the folders are.
        name: The name wanted.
        scenario_toml: The scenario.toml that will be written there.

    Returns:
        The folder, which need not exist yet.
    """
    for number in itertools.count(1):
        folder = parent / (name if number == 1 else f"{name}-{number}")
        scenario = folder / "scenario.toml"
        if not folder.exists() or (scenario.is_file() and scenario.read_text(encoding="utf-8") == scenario_toml):
            return folder
    raise AssertionError("count() does not end")


def write_result(folder: Path, files: Mapping[str, Callable[[Path], None]]) -> None:
    """Write every file that can be written, then complain of those that cannot. What an earlier run left goes first."""
    for pattern in ("trajectory*.parquet", "recording.rrd", "summary.json", "plot.png"):
        for stale in folder.glob(pattern):
            if stale.is_file():
                stale.unlink()
    wrong = {}
    for name, write in files.items():
        try:
            write(folder / name)
        except Exception as error:  # a title that no file can hold: the other files are kept all the same
            wrong[name] = error
    if wrong:
        why = "; ".join(
            f"{folder / name}: cannot be written: {getattr(error, 'strerror', None) or raised(error)}"
            for name, error in wrong.items()
        )
        raise InputError(why)
