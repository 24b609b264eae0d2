"""The workers' folder in the temporary one: gone at the end, and after a kill at the next start."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from cmg_mj.results.run_folder.lock import Lock
from cmg_mj.studies.sweeps.scratch import LOCK, OURS, scratch_folder
from tests.command import HANGS_AFTER_S, environment

KILLED = """
import os, signal
from pathlib import Path
from cmg_mj.studies.sweeps.scratch import scratch_folder
with scratch_folder() as folder:
    (Path(folder) / "dask").mkdir()
    (Path(folder) / "dask" / "spilled").write_text("much")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(autouse=True)
def _temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def made(folder: Path) -> Path:
    """A folder as a killed sweep leaves it."""
    folder.mkdir()
    for name in (LOCK, OURS):
        (folder / name).touch()
    return folder


def test_it_is_gone_at_the_end(tmp_path: Path) -> None:
    with scratch_folder() as folder, scratch_folder() as other:
        assert Path(folder) != Path(other)
        assert {str(path) for path in tmp_path.iterdir()} == {folder, other}
        (Path(folder) / "spilled").write_text("much", encoding="utf-8")
    assert list(tmp_path.iterdir()) == []


def test_that_of_a_killed_process_is_gone_at_the_next_start(tmp_path: Path) -> None:
    words = [sys.executable, "-c", KILLED]
    done = subprocess.run(
        words, env=environment(TMPDIR=str(tmp_path)), capture_output=True, timeout=HANGS_AFTER_S, check=False
    )
    assert done.returncode == -9, done.stderr
    (left,) = tmp_path.iterdir()
    assert (left / "dask" / "spilled").exists()
    with scratch_folder() as folder:
        assert [str(path) for path in tmp_path.iterdir()] == [folder]


def test_what_is_not_certainly_such_a_folder_stays(tmp_path: Path) -> None:
    alive = made(tmp_path / "cmg-mj-alive")
    lock = Lock(alive / LOCK)
    (tmp_path / "cmg-mj-mine").mkdir()
    (tmp_path / "cmg-mj-mine" / "notes").write_text("mine", encoding="utf-8")
    (made(tmp_path / "cmg-mj-unmarked") / OURS).unlink()
    (tmp_path / "cmg-mj-file").write_text("mine", encoding="utf-8")
    made(tmp_path / "elsewhere")
    (tmp_path / "cmg-mj-link").symlink_to("elsewhere")
    linked = made(tmp_path / "cmg-mj-linked")
    (linked / LOCK).unlink()
    (linked / LOCK).symlink_to(tmp_path / "cmg-mj-file")
    before = sorted(tmp_path.rglob("*"))
    with scratch_folder():
        pass
    assert sorted(tmp_path.rglob("*")) == before
    lock.release()


def test_links_in_it_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes").write_text("mine", encoding="utf-8")
    left = made(tmp_path / "cmg-mj-left")
    os.symlink(tmp_path / "mine", left / "link")
    with scratch_folder():
        assert not left.exists()
    assert (tmp_path / "mine" / "notes").exists()
