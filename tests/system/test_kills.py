"""Killed at any moment, a run leaves the old result or the new one."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.command import HANGS_AFTER_S, environment

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.mark.parametrize(
    ("mode", "kills"),
    [
        pytest.param("every", 15, id="before every change of a file"),
        pytest.param("random", 40, id="whole runs, at random moments", marks=pytest.mark.slow),
    ],
)
def test_kills(mode: str, kills: int) -> None:
    process = subprocess.run(
        [sys.executable, "-m", "tests.system.kill_writers", mode],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    assert int(process.stdout.split()[0]) >= kills, process.stdout
