"""The cost of an update on the emulated board."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from cmg_mj.papers.aranovskiy2020 import riccati
from tests.command import HANGS_AFTER_S, ROOT
from tests.features.board.toy import needs_board

SCRIPT = ROOT / "benchmarks" / "board.py"

pytestmark = needs_board


@pytest.mark.slow
@pytest.mark.skipif(not SCRIPT.exists(), reason="a source distribution has no benchmarks")
def test_what_they_cost() -> None:
    process = subprocess.run(
        [sys.executable, SCRIPT, "--observers", "linear,homogeneous", "--json"],
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
    )
    linear, homogeneous = json.loads(process.stdout)["figures"]
    assert linear["step_instructions"] < 0.1 * homogeneous["step_instructions"]
    for row in (linear, homogeneous):
        assert row["step_instructions"] < row["update_instructions"] <= row["update_instructions_most"]
        assert row["update_us_at_216_mhz"] == pytest.approx(row["update_instructions"] / 216.0)
        assert 40 <= row["stack_bytes"] <= 1000
        assert 100 <= row["flash_bytes"] <= 20_000
        # The recorded ones are of half a second; another compiler or C library makes some per cent more or less.
        assert row["step_instructions"] == pytest.approx(
            json.loads(riccati.RECORDED.read_text())[row["observer"]], rel=0.1
        )
    # Of the observer tilt, rate and last sample; integrator, last command, whether it has started, status.
    assert linear["state_bytes"] == 7 * 4
