"""free_pivot beside the bank of docs/studies/free_pivot_motions.py, an estimator of another kind with own equations."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "docs/studies/free_pivot_motions.py"
DAILY = ("turn 0.25", "impact 2", "knocks 10, 10 ms")
BEFORE = {"walk 2": 0.88, "walk 1, no strikes": 0.98, "bus 0.2": 0.96, "sine 2 Hz, 0.5": 0.83}
"""Where `free_pivot` of version 0.2.0 was better than the bank: its error by the bank's, of 200 worlds."""

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


def by_the_bank(name: str, worlds: int) -> tuple[float, float]:
    """Error of `free_pivot` by the bank's, of the mean world, and its standard error."""
    work = study()
    rig = work.known_rig()
    recording = work.record(rig, name, worlds, 960_000)
    observers = work.FreePivot(work.DT, rig.model, rig.noise), work.Bank(rig)
    ours, theirs = (
        np.sqrt(np.square(work.estimated(each, recording) - recording.rate).mean(axis=0)) for each in observers
    )
    ratio = float(ours.mean() / theirs.mean())
    return ratio, float((ours - ratio * theirs).std(ddof=1) / theirs.mean() / np.sqrt(len(ours)))


@pytest.mark.parametrize(
    ("name", "worlds"),
    [
        *((name, 24) for name in DAILY),
        *(pytest.param(name, 40, marks=pytest.mark.slow) for name in (study().MOTIONS if SCRIPT.exists() else ())),
    ],
)
def test_it_is_within_a_tenth_of_the_better_of_two(name: str, worlds: int) -> None:
    """The bank and itself before it had a gate and a slow filter; two standard errors are chance.

    Its numbers were chosen on other seeds, with this one in sight at the end.
    """
    ratio, chance = by_the_bank(name, worlds)
    assert chance < 0.05
    assert ratio - 2.0 * chance < 1.1 * BEFORE.get(name, 1.0)
