"""Every file of examples/ runs as it is shown: in a process of its own, from any folder."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import HANGS_AFTER_S, ROOT, environment

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

SAYS = {
    "bias_estimation": "found",
    "control_callback": "the tilt is",
    "many_worlds": "homogeneous beside ltv: better",
    "own_law": "own_law:Leaning: 5 of 5 stood",
    "own_loop": "estimated tilt rate",
    "own_observer": "own_observer:HalfDifference: 0 of 5 fell",
    "python_control": "slowest pole -0.20",
    "runner": "the callback's run is the same: True",
    "tuning": "better",
}
"""Example -> a part of what it prints."""


def test_there_is_an_example_for_each() -> None:
    assert [path.stem for path in EXAMPLES] == sorted(SAYS)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_runs(path: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, path], cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=HANGS_AFTER_S
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert SAYS[path.stem] in done.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_is_short_and_says_what_it_is(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 40
    assert ast.get_docstring(ast.parse(text))
    assert f"examples/{path.name}" in (ROOT / "README.md").read_text(encoding="utf-8")
