"""The README is short and true: its snippets and commands run, its figures are those of the pages behind it."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cmg_mj.observers import OBSERVERS
from cmg_mj.papers import PAPERS
from cmg_mj.results.baselines import REFERENCES
from tests.command import HANGS_AFTER_S, ROOT, cmg_mj, environment

README = (ROOT / "README.md").read_text(encoding="utf-8")
GUIDE = (
    (ROOT / "docs" / "which_observer.md")
    .read_text(encoding="utf-8")
    .split("\n## Every observer\n")[1]
    .split("\n## ")[0]
)
"""The whole table, of which README has eight rows."""
REPRODUCED = (ROOT / "docs" / "reproduced.md").read_text(encoding="utf-8")

MOST_WORDS = 900
WIDTH = 100
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


def tables(text: str) -> dict[str, list[str]]:
    """Return the observer at the beginning of a table's row -> the row's other cells."""
    rows = re.findall(r"^\| `(\w+)` \|(.*)\|$", text, flags=re.MULTILINE)
    return {name: [cell.strip() for cell in rest.split("|")] for name, rest in rows}


def test_is_one_page() -> None:
    assert len(README.split()) < MOST_WORDS
    assert [line for line in README.splitlines() if len(line) > WIDTH] == []


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


def test_commands_were_read() -> None:
    assert {line.split()[1] for line in COMMANDS} == set(CHEAPER)


def test_every_shell_takes_the_commands() -> None:
    """What zsh would take for a pattern, or bash for a list, is in quotes."""
    for block in BLOCKS:
        bare = re.sub(r"'[^']*'|\"[^\"]*\"", "", block)
        assert not re.search(r"[][*?{}<>~$!;]", bare), block


def test_the_first_run_is_where_it_says() -> None:
    """The name of the recording is that of a run's folder, which tests/studies/test_save.py looks into."""
    assert COMMANDS[0] == "cmg-mj run push_recovery"
    assert "\nrerun runs/push_recovery-homogeneous-0/recording.rrd\n" in README


def test_the_table_is_that_of_the_guide_rounded() -> None:
    rows, guide = tables(README), tables(GUIDE)
    assert len(rows) == 8
    for name, (error, at_push, instructions, _) in rows.items():
        assert [error, at_push] == [f"{float(cell.split()[0]):.3f}" for cell in guide[name][:2]], name
        assert instructions in guide[name], name


def test_the_guide_has_every_observer() -> None:
    assert set(tables(GUIDE)) >= {*OBSERVERS, *REFERENCES}


def test_the_result_is_that_of_the_table() -> None:
    """The papers' observers are all that do not use the acceleration."""
    guide = tables(GUIDE)
    error = {name: float(guide[name][0].split()[0]) for name in OBSERVERS if guide[name][0] != "-"}
    others = [value for name, value in error.items() if name not in ("gyro_free", "free_pivot")]
    text = " ".join(README.split())
    assert f"`gyro_free` is wrong by {error['gyro_free']:.3f} rad/s" in text
    assert f"the best observer of the four papers behind this bench by {min(others):.3f} rad/s" in text
    assert f"fused with the measured tilt, is wrong by {float(guide['mems_fused'][0].split()[0]):.3f} rad/s" in text


def test_the_claims_are_those_of_the_report() -> None:
    counts = re.search(r"(\d+) claims of the papers: .*? (\d+) not reproduced", REPRODUCED, flags=re.DOTALL)
    assert counts
    words = " ".join(README.split())
    assert f"{counts[1]} claims of four papers" in words
    assert f"{counts[2]} of them could not be reproduced" in words
    assert all(f"## {paper}:" in REPRODUCED for paper in PAPERS)


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
