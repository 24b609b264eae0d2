"""Scripts of docs/studies whose tables the documentation and the changelog name."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

STEPS = Path(__file__).resolve().parents[1] / "docs/studies/steps.py"


def test_the_table_of_steps() -> None:
    arguments = "--worlds 2 --observers linear --integrators RK4 --steps-ms 2.5,5 --set duration_s=0.5 --set push=[]"
    done = subprocess.run([sys.executable, STEPS, *arguments.split()], capture_output=True, text=True, check=True)
    rows = [line for line in done.stdout.splitlines() if line.startswith("| RK4")]
    assert len(rows) == 2
    assert "0.00 %" in rows[0]
