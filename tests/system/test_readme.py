"""The README is true: its snippets and commands run."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import HANGS_AFTER_S, ROOT, cmg_mj, environment

README = (ROOT / "README.md").read_text(encoding="utf-8")
SNIPPETS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
BLOCKS = re.findall(r"```sh\n(.*?)```", README, flags=re.DOTALL)
COMMANDS = [line for block in BLOCKS for line in block.replace("\\\n ", "").splitlines() if line.startswith("cmg-mj ")]
"""Lines that a user types, those that a backslash continues as one."""
CHEAPER = {
    "run": "",
    "compare": "--worlds 2 --set duration_s=2.5 --set push.0.start_s=1.0",
    "sweep": "--set duration_s=2.5 --set push.0.start_s=1.0",
    "replay": "--observers linear",
    "mount": "--quick",
}
"""Command -> what is appended here, so that it takes a second or two."""


@pytest.mark.slow
@pytest.mark.parametrize("line", COMMANDS)
@pytest.mark.usefixtures("elsewhere")
def test_a_command_runs(line: str) -> None:
    """With the README's observer in the current folder, as it says."""
    for code in SNIPPETS:
        name = re.match(r"# (\w+\.py)\n", code)
        assert name, "a snippet begins with the name of its file"
        Path(name[1]).write_text(code, encoding="utf-8")
    shutil.copytree(ROOT / "examples", "examples")
    command, *arguments = shlex.split(line)[1:]
    assert command in CHEAPER, f"{line}: say in CHEAPER how to try it"
    outcome = cmg_mj(command, *arguments, *shlex.split(CHEAPER[command]))
    assert outcome.status == 0, outcome
    assert outcome.out


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "SECURITY.md"])
def test_links_lead_somewhere(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!\w+:|#)([^)#]+)", text):
        assert (ROOT / target).exists(), target


@pytest.mark.slow
def test_the_snippet_is_python(tmp_path: Path) -> None:
    for code in SNIPPETS:
        process = subprocess.run(
            [sys.executable, "-W", "error", "-c", code],
            cwd=tmp_path,
            env=environment(),
            capture_output=True,
            text=True,
            timeout=HANGS_AFTER_S,
        )
        assert (process.returncode, process.stdout, process.stderr) == (0, "", "")
