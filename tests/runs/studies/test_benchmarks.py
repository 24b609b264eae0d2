"""The scripts that measure speed. How large the ratios are is for a quiet machine: .ci/speed.py."""

from __future__ import annotations

import runpy
from typing import Any

import pytest

from tests.command import ROOT

SCRIPTS = ROOT / "benchmarks"

pytestmark = pytest.mark.skipif(not SCRIPTS.exists(), reason="a source distribution has no benchmarks")


def measure(script: str, observer: str, worlds: int, **values: Any) -> list[dict[str, Any]]:
    """Run a benchmark, briefly."""
    function = runpy.run_path(str(SCRIPTS / script))["measure"]
    function.__globals__.update(values)
    return function([observer], worlds)["figures"]


def test_loop() -> None:
    short = {"REPEATS": 1, "ONE_WORLD_S": 0.1, "MANY_WORLDS_S": 0.1, "CONTROL_RATES_HZ": (200.0,)}
    (figures,) = measure("loop.py", "linear", 2, **short)
    assert figures["closed_loop_over_bare"] == pytest.approx(figures["closed_loop_ms"] / figures["bare_ms"])
    share = figures["batch_ms"] / figures["closed_loop_batch_ms"]
    assert figures["closed_loop_share_of_batch"] == pytest.approx(share)
    assert figures["timestep_ms"] == 5.0
