"""Peak memory of long work, read off a child process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

MEASURED = """
import resource, sys
from cmg_mj.cli import main
sys.argv[0], status = "cmg-mj", 0
try:
    main()
except SystemExit as end:
    status = end.code or 0
print(status, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024, file=sys.stderr)
"""
MOST_MB = 500


def peak_mb(*arguments: str, folder: Path) -> int:
    """Run a command and return its peak of resident memory [MB]."""
    command = [sys.executable, "-c", MEASURED, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    status, peak = done.stderr.split()[-2:]
    assert status == "0", done.stderr
    return int(peak)


@pytest.mark.slow
def test_a_long_run_with_its_recording_and_plot(tmp_path: Path) -> None:
    settings = ("duration_s=2000", 'open_loop_observers=["linear", "kalman"]')
    options = [argument for setting in settings for argument in ("--set", setting)]
    peak = peak_mb("run", "push_recovery", "--plot", "--out", "out", "--json", *options, folder=tmp_path)
    assert peak < MOST_MB
    assert (tmp_path / "out" / "recording.rrd").stat().st_size > 100e6
