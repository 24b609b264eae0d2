"""Killed at any moment, a run leaves the old result or the new one."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.command import HANGS_AFTER_S, environment


@pytest.mark.usefixtures("elsewhere")
def test_kills_before_every_change_of_a_file() -> None:
    process = subprocess.run(
        [sys.executable, "-m", "tests.system.kill_writers"],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
    )
    assert process.returncode == 0, process.stderr
    assert int(process.stdout.split()[0]) >= 15, process.stdout
