"""free_pivot beside the bank of docs/studies/free_pivot_motions.py, an estimator of another kind with own equations."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "docs/studies/free_pivot_motions.py"
FARTHER = {"brake": 1.6, "turn": 1.35, "hand": 1.35}
"""Kinds of motion on which its error may be so many times the bank's."""
DAILY = ("turn 0.25", "impact 2", "knocks 10, 10 ms")

pytestmark = pytest.mark.skipif(not SCRIPT.exists(), reason="a source distribution has no studies")


def study() -> Any:
    """The script as a module."""
    if SCRIPT.stem not in sys.modules:
        spec = importlib.util.spec_from_file_location(SCRIPT.stem, SCRIPT)
        assert spec is not None
        assert spec.loader is not None
        sys.modules[SCRIPT.stem] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[SCRIPT.stem])
    return sys.modules[SCRIPT.stem]


def motions() -> list[Any]:
    """Every motion, most of them slow."""
    names = study().MOTIONS if SCRIPT.exists() else ()
    marks = {name: () if name in DAILY else (pytest.mark.slow,) for name in names}
    return [pytest.param(name, marks=marks[name]) for name in names]


def error(estimate: np.ndarray, rate: np.ndarray) -> float:
    """Mean RMS error of all worlds [rad/s]."""
    return float(np.sqrt(np.square(estimate - rate).mean(axis=0)).mean())


@pytest.mark.parametrize("name", motions())
def test_on_each_motion_it_is_near_the_bank(name: str) -> None:
    """Within 1.1 but for long pushes to one side and slow shaking (docs/real_rigs_evidence.md); the rest is chance."""
    work = study()
    rig = work.known_rig()
    recording = work.record(rig, name, 12, 910_000)
    ours, theirs = (
        error(work.estimated(observer, recording), recording.rate)
        for observer in (work.FreePivot(work.DT, rig.model, rig.noise), work.Bank(rig))
    )
    assert ours < FARTHER.get(name.partition(" ")[0], 1.15) * theirs
