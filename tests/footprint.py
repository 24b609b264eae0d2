"""A test that leaves a file or folder in the repository, outside a folder of its own, fails."""

from __future__ import annotations

import os
from collections.abc import Generator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("cmg_mj", "docs", "examples", "models", "scenarios", "tests", "typings")
"""Looked at with all below them; of the rest, an environment for instance, the root's own entries are seen."""


class Footprint:
    """The contents of the folders of a repository.

    A folder's time of change tells whether an entry came or went, so a look at it costs a call for each folder.

    Attributes:
        root: The repository.
        entries: Folder -> time of change [ns], names in it.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.entries: dict[str, tuple[int, frozenset[str]]] = {}
        subfolders = (top for name in FOLDERS for top, *_ in os.walk(root / name) if "__pycache__" not in top)
        for folder in (str(root), *subfolders):
            self.entries[folder] = (os.stat(folder).st_mtime_ns, visible(folder))

    def additions(self) -> list[str]:
        """Return what has come since the last look, relative to the root."""
        new_names = []
        for folder, (last_mtime_ns, names) in list(self.entries.items()):
            try:
                mtime_ns = os.stat(folder).st_mtime_ns
            except FileNotFoundError:
                del self.entries[folder]
                continue
            if mtime_ns != last_mtime_ns:
                present = visible(folder)
                new_names += [
                    os.path.relpath(os.path.join(folder, name), self.root) for name in sorted(present - names)
                ]
                self.entries[folder] = (mtime_ns, present)
        return new_names


def visible(folder: str) -> frozenset[str]:
    """Names in a folder, without hidden ones and those that need no test to appear."""
    return frozenset(name for name in os.listdir(folder) if name[0] != "." and name != "__pycache__")


FOOTPRINT = pytest.StashKey[Footprint]()


def pytest_sessionstart(session: pytest.Session) -> None:
    """Look round before the first test."""
    session.stash[FOOTPRINT] = Footprint(ROOT)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Fail at the teardown a test that left something."""
    report = yield
    if call.when == "teardown" and (litter := item.session.stash[FOOTPRINT].additions()) and report.passed:
        report.outcome = "failed"
        report.longrepr = (
            f"{item.nodeid}: {', '.join(litter)} came into the repository while this test ran; a test writes into "
            "`tmp_path` alone (among several workers it can be another's test: look with -n 0)"
        )
    return report
