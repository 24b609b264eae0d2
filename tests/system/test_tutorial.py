"""docs/tutorial.md: every block runs, one after the other, and what the page prints is printed."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.command import HANGS_AFTER_S, ROOT, cmg_mj, environment

TEXT = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
LAID_OUT = ("models", "examples", "scenarios")
"""Folders of a clone that the page uses."""
COMMENT = re.compile(r"(?:# |<!-- )([\w.]+)")
NUMBER = re.compile(r"[-+]?\d+(?:\.(\d+))?")
OF_THE_READER = ("python -m venv", "python -m pip", "rerun ")
"""Lines for which a test has no screen, no network, or an environment already."""


@dataclass(frozen=True)
class Block:
    language: str
    text: str

    @property
    def lines(self) -> list[str]:
        """Lines of text or commands, those that a backslash continues as one."""
        return self.text.replace("\\\n", " ").splitlines()

    @property
    def file(self) -> str | None:
        """The file that the block is to be saved as: its first line names it in a comment."""
        name = COMMENT.match(self.text)
        return name[1] if name and self.language not in ("sh", "text") else None


BLOCKS = [Block(*block) for block in re.findall(r"```(\w+)\n(.*?)```", TEXT, flags=re.DOTALL)]


def equal(expected: str, printed: str) -> bool:
    """Compare two words; numbers to the decimals that are expected, but for the last one's half."""
    expected, printed = expected.rstrip(",;"), printed.rstrip(",;")
    number, other = NUMBER.fullmatch(expected), NUMBER.fullmatch(printed)
    if not number or not other:
        return expected == printed
    return abs(float(expected) - float(printed)) <= 0.501 * 10.0 ** -len(number[1] or "")


def line_of(expected: str, output: list[str]) -> int | None:
    """Return the number of the first line of an output that contains the expected words side by side."""
    words = expected.split()
    for number, line in enumerate(output):
        printed = line.strip("| ").split()
        for first in range(len(printed) - len(words) + 1):
            if all(map(equal, words, printed[first : first + len(words)])):
                return number
    return None


def run_line(line: str) -> str:
    """Run a command of the page in the current folder; return what it prints."""
    if line.startswith("rerun "):
        assert Path(line.split()[1]).is_file(), line
    if line.startswith(OF_THE_READER):
        return ""
    if line.startswith("cmg-mj "):
        outcome = cmg_mj(*shlex.split(line)[1:])
        assert outcome.status == 0, (line, outcome)
        return outcome.out + outcome.err
    process = subprocess.run(
        ["bash", "-c", line.replace("python ", f"{shlex.quote(sys.executable)} ")],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
    )
    assert process.returncode == 0, (line, process.stderr)
    return process.stdout


@pytest.mark.slow
@pytest.mark.usefixtures("elsewhere")
def test_every_block_prints_what_the_page_says() -> None:
    pytest.importorskip("gymnasium")
    for folder in LAID_OUT:
        shutil.copytree(ROOT / folder, folder)
    output: list[str] = []
    for block in BLOCKS:
        if block.language == "sh":
            output = [line for command in block.lines for line in run_line(command).splitlines()]
        elif block.file:
            Path(block.file).write_text(block.text, encoding="utf-8")
        else:
            below = 0
            for expected in block.lines:
                found = line_of(expected, output[below:])
                assert found is not None, (expected, output[below:])
                below += found + 1
    for picture in ("pictured/plot.png", *map(str, Path("map").glob("map_*.png"))):
        assert Path(picture).stat().st_size > 0
    assert len(list(Path("map").glob("map_*.png"))) >= 2
