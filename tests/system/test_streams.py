"""Standard streams that are closed, full or not read, and a current folder that is gone."""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path

import pytest

from tests.command import COMMAND, HANGS_AFTER_S, environment

CMG_MJ = shlex.join(COMMAND)


def shell(script: str, cwd: Path) -> subprocess.CompletedProcess:
    """Run a line of bash, in which $CMG_MJ is the command."""
    return subprocess.run(
        ["bash", "-c", script.replace("$CMG_MJ", CMG_MJ)],
        cwd=cwd,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
    )


@pytest.mark.parametrize(
    ("script", "status", "err"),
    [
        pytest.param("$CMG_MJ list | true; exit ${PIPESTATUS[0]}", 0, "", marks=pytest.mark.slow),
        ("$CMG_MJ --help | true; exit ${PIPESTATUS[0]}", 0, ""),
        pytest.param("$CMG_MJ check push_recovery | true; exit ${PIPESTATUS[0]}", 0, "", marks=pytest.mark.slow),
        pytest.param("$CMG_MJ check nosuch 2>&1 | true; exit ${PIPESTATUS[0]}", 2, "", marks=pytest.mark.slow),
        pytest.param("$CMG_MJ list >&-", 0, "", marks=pytest.mark.slow),
        pytest.param("$CMG_MJ list >&- 2>&-", 0, "", marks=pytest.mark.slow),
        pytest.param("$CMG_MJ check nosuch >&- 2>&-", 2, "", marks=pytest.mark.slow),
        pytest.param(
            "$CMG_MJ list >/dev/full", 2, "cmg-mj: standard output: No space left on device\n", marks=pytest.mark.slow
        ),
        pytest.param("$CMG_MJ check nosuch 2>/dev/full", 2, "", marks=pytest.mark.slow),
    ],
)
def test_streams(script: str, status: int, err: str, tmp_path: Path) -> None:
    process = shell(script, tmp_path)
    assert (process.returncode, process.stderr) == (status, err)


@pytest.mark.slow
def test_a_run_whose_output_is_closed_is_written_whole(tmp_path: Path) -> None:
    """A file that got the number of standard output would have the summary in it."""
    (tmp_path / "quick.toml").write_text("duration_s = 0.1")
    process = shell("$CMG_MJ run quick.toml --out it >&-", tmp_path)
    assert process.returncode == 0
    assert (tmp_path / "it" / "trajectory.parquet").read_bytes().endswith(b"PAR1")


@pytest.mark.slow
def test_a_current_folder_that_is_gone(tmp_path: Path) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()
    process = shell(
        f"rmdir ../gone; $CMG_MJ check push_recovery >/dev/null && $CMG_MJ run push_recovery --out {tmp_path}", folder
    )
    assert process.returncode == 2
    assert process.stderr == "cmg-mj: the current folder: No such file or directory\n"
    assert os.listdir(tmp_path) == []
