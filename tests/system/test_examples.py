"""Every file of examples/ runs as it is shown: in a process of its own, from any folder."""

from __future__ import annotations

import ast
import runpy
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import cmg_mj
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
"""Take a robot that has a plugin: they run in tests/codegen/engine_plugin/test_mount.py."""
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


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_is_short_and_says_what_it_is(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 40
    assert ast.get_docstring(ast.parse(text))
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    assert any(f"examples/{path.name}" in page.read_text(encoding="utf-8") for page in pages)


class StandIn:
    """A viewer that is closed after a second of simulated time; at half of it somebody presses space."""

    def __init__(self, model: Any, data: Any, key_callback: Any) -> None:
        self.data, self.key_callback, self.synced = data, key_callback, 0
        viewers.append(self)

    def __enter__(self) -> StandIn:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def is_running(self) -> bool:
        return self.data.time < 1.0

    def sync(self) -> None:
        self.synced += 1
        if abs(self.data.time - 0.5) < 1e-9:
            self.key_callback(ord("x"))
            self.key_callback(ord(" "))


viewers: list[StandIn] = []


def test_the_viewers_loop_at_a_viewer(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """In real time, with a push where the key was pressed."""
    monkeypatch.setattr("mujoco.viewer.launch_passive", StandIn)
    monkeypatch.setattr(sys, "argv", ["mujoco_viewer.py"])
    start = time.monotonic()
    runpy.run_path(str(ROOT / "examples" / "mujoco_viewer.py"))
    assert time.monotonic() - start > 0.9
    assert "pushed at 0.50 s; at 1.00 s the tilt is" in capsys.readouterr().out
    assert viewers[-1].synced == pytest.approx(1.0 / cmg_mj.load_plant(model="scissored_pair.xml").timestep, abs=1)


@pytest.mark.slow
def test_bode_and_step_labels_its_axes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib.pyplot as plt

    plt.switch_backend("agg")
    plt.close("all")
    path = ROOT / "examples" / "bode_and_step.py"
    monkeypatch.setattr(sys, "argv", [str(path), str(tmp_path / "bode.png")])
    runpy.run_path(str(path))
    gain, phase, step = plt.gcf().axes
    assert (gain.get_ylabel(), phase.get_ylabel(), step.get_ylabel()) == ("gain [-]", "phase [deg]", "angle [deg]")
    assert (phase.get_xlabel(), step.get_xlabel()) == ("frequency [rad/s]", "time [s]")
    assert gain.get_title()
    assert step.get_title()
    plt.close("all")
