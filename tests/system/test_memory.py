"""Peak memory of long work, read off a child process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pytest

MEASURED = """
import sys
from cmg_mj.cli import main
sys.argv[0], status = "cmg-mj", 0
try:
    main()
except SystemExit as end:
    status = end.code or 0
with open("/proc/self/status") as file:  # ru_maxrss would count the parent's memory at the fork too
    peak_kb = next(int(line.split()[1]) for line in file if line.startswith("VmHWM"))
print(status, peak_kb // 1024, file=sys.stderr)
"""
MAX_MB = 1000


def peak_mb(*arguments: str, folder: Path) -> int:
    """Run a command and return its peak of resident memory [MB]."""
    command = [sys.executable, "-c", MEASURED, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    status, peak = done.stderr.split()[-2:]
    assert status == "0", done.stderr
    print(f"peak {peak} MB")
    return int(peak)


@pytest.mark.slow
def test_a_long_run_with_its_recording_and_plot(tmp_path: Path) -> None:
    settings = ("duration_s=2000", 'open_loop_observers=["linear", "kalman"]')
    options = [argument for setting in settings for argument in ("--set", setting)]
    peak = peak_mb("run", "push_recovery", "--plot", "--out", "out", "--json", *options, folder=tmp_path)
    assert peak < MAX_MB
    assert (tmp_path / "out" / "recording.rrd").stat().st_size > 20e6


@pytest.mark.slow
@pytest.mark.parametrize("jitter_s", [0.0, 0.0008])
def test_a_long_log_through_two_observers(tmp_path: Path, jitter_s: float) -> None:
    """100 MB in ten columns, as a logger writes them that prints all digits; its stamps may be uneven."""
    random, rows, done = np.random.default_rng(0), 100_000, 0
    path = tmp_path / "log.csv"
    with path.open("wb") as file:
        while file.tell() < 100e6:
            t = 0.005 * (done + np.arange(rows)) + jitter_s * random.uniform(-1.0, 1.0, rows)
            tilt = 0.02 * np.sin(2.0 * t) + 0.01 * np.sin(11.0 * t) + 0.001 * random.standard_normal(rows)
            rate = 0.04 * np.cos(2.0 * t) + 0.11 * np.cos(11.0 * t)
            others = {f"other_{k}": random.standard_normal(rows) for k in range(7)}
            table = pa.table({"t_s": t, "tilt_rad": tilt, "rate_rad_s": rate, **others})
            pacsv.write_csv(table, file, pacsv.WriteOptions(include_header=not done))
            done += rows
    options = [
        "--columns",
        "time=t_s,tilt=tilt_rad,rate=rate_rad_s",
        "--observers",
        "linear_high_gain,finite_difference",
    ]
    peak = peak_mb("replay", "log.csv", *options, "--json", "--out", "out", folder=tmp_path)
    assert peak < MAX_MB
    assert (tmp_path / "out" / "recording.rrd").stat().st_size > 20e6
