"""`.ci/speed.py` judges the figures of `benchmarks/loop.py`: neither too slow nor quicker than the physics in it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.command import HANGS_AFTER_S, ROOT

SCRIPT = ROOT / ".ci" / "speed.py"


@pytest.mark.skipif(not SCRIPT.exists(), reason="a source distribution has no .ci")
@pytest.mark.parametrize(
    ("over_bare", "share_of_batch", "words", "is_failure"),
    [
        (2.8, 0.8, "kept", False),
        (3.3, 0.8, "beyond its limit", False),
        (5.0, 0.8, "FAILED", True),
        (2.8, 0.5, "FAILED", True),
        (0.1, 0.8, "FAILED, quicker than its physics alone", True),
        (2.8, 1.5, "FAILED, quicker than its physics alone", True),
    ],
)
def test_verdict(over_bare: float, share_of_batch: float, words: str, is_failure: bool) -> None:
    row = {"observer": "linear", "closed_loop_over_bare": over_bare, "closed_loop_share_of_batch": share_of_batch}
    rows = [{**row, "control_rate_hz": rate} for rate in (200.0, 1000.0)]
    process = subprocess.run(
        [sys.executable, SCRIPT],
        input=json.dumps({"figures": rows}),
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
    )
    assert (process.returncode, process.stderr) == (int(is_failure), "")
    assert [line.rpartition("): ")[2] for line in process.stdout.splitlines()] == [words, words]
