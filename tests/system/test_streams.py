"""Standard streams that are closed, full or not read."""

from __future__ import annotations

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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "status"),
    [
        ("$CMG_MJ list | true; exit ${PIPESTATUS[0]}", 0),
        ("$CMG_MJ check nosuch 2>&1 | true; exit ${PIPESTATUS[0]}", 2),
        ("$CMG_MJ list >&- 2>&-", 0),
        ("$CMG_MJ list >/dev/full 2>/dev/null", 2),
    ],
)
def test_streams(script: str, status: int, tmp_path: Path) -> None:
    process = shell(script, tmp_path)
    assert (process.returncode, process.stderr) == (status, "")


@pytest.mark.slow
def test_a_run_whose_output_is_closed_is_written_whole(tmp_path: Path) -> None:
    """A file that got the number of standard output would have the summary in it."""
    (tmp_path / "quick.toml").write_text("duration_s = 0.1")
    process = shell("$CMG_MJ run quick.toml --out it >&-", tmp_path)
    assert process.returncode == 0
    assert (tmp_path / "it" / "trajectory.parquet").read_bytes().endswith(b"PAR1")
