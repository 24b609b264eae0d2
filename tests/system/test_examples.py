"""Every file of examples/ runs as it is shown: in a process of its own, from any folder."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import HANGS_AFTER_S, ROOT, environment

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

OUTPUT = {
    "bias_estimation": "found",
    "bicycle": "fed back by the observer: 5 of 5 stood",
    "bode_and_step": "phase margin 65.9 deg",
    "closed_loop": "gyro_free: largest pole 0.9990, comes within 0.80 of -1, tilts by 1.45 deg",
    "control_callback": "the tilt is",
    "gymnasium_env": "observer and law: stood until 4.00 s",
    "gymnasium_robot": "pushed with 1.8 of E: 0 of 5 stood",
    "many_worlds": "homogeneous beside ltv: better",
    "mujoco_viewer": "pushed at 1.00 s; at 4.00 s the tilt is",
    "own_law": "own_law:Leaning: 5 of 5 stood",
    "own_loop": "estimated tilt rate",
    "own_observer": "own_observer:HalfDifference: 0 of 5 fell",
    "own_robot": "pushed with 0.6 of that: stood until 20 s",
    "python_control": "slowest pole -0.20",
    "replay_a_log": "super_twisting: velocity RMS error",
    "runner": "the callback's run is the same: True",
    "sweep_biases": "homogeneous at e = 2.0 deg: 0 of 5 stood",
    "tuning": "better",
}
"""Example -> a part of what it prints."""
WITH_A_ROBOT = ["gymnasium_own_robot", "gymnasium_plugin"]
"""Take a robot that has a plugin: they run in tests/features/plugin/test_mount.py."""
OPTIONS = {"mujoco_viewer": ["--headless"]}
"""The same loop where there is no screen."""


def test_there_is_an_example_for_each() -> None:
    assert [path.stem for path in EXAMPLES] == sorted([*OUTPUT, *WITH_A_ROBOT])


@pytest.mark.slow
@pytest.mark.parametrize("path", [path for path in EXAMPLES if path.stem in OUTPUT], ids=lambda path: path.stem)
def test_runs(path: Path, tmp_path: Path) -> None:
    process = subprocess.run(
        [sys.executable, path, *OPTIONS.get(path.stem, [])],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
    )
    assert (process.returncode, process.stderr) == (0, "")
    assert OUTPUT[path.stem] in process.stdout
    assert list(tmp_path.iterdir()) == []
