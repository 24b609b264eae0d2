"""The README is true: its snippets and commands run, and its tables are complete."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cmg_mj.cli import cli
from cmg_mj.codegen.board.tools import missing
from cmg_mj.inputs.bundled import bundled
from cmg_mj.observers import OBSERVERS
from cmg_mj.papers import PAPERS
from cmg_mj.results.baselines import REFERENCES
from tests.command import HANGS_AFTER_S, ROOT, cmg_mj, environment

README = (ROOT / "README.md").read_text(encoding="utf-8")

SNIPPETS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
SHELL = [line for block in re.findall(r"```sh\n(.*?)```", README, flags=re.DOTALL) for line in block.splitlines()]
COMMANDS = [part.strip() for line in SHELL for part in line.split("&&") if part.strip().startswith("cmg-mj ")]
INLINE = re.findall(r"`(cmg-mj \w+ [^`]+)`", README)

CHEAPER = {
    "check": "",
    "run": "",
    "compare": "--worlds 2 --set duration_s=2.5 --set push.0.start_s=1.0",
    "tune": "--worlds 2 --set duration_s=3.0",
    "sweep": "--sample 2 --worlds 2 --set duration_s=2.5 --set push.0.start_s=1.0",
    "replay": "--observers linear",
    "export": "",
    "mount": "--quick",
    "plugin": "",
}
"""Command -> what is appended here, so that it takes a second or two."""


def section(title: str) -> str:
    return README.split(f"\n## {title}\n")[1].split("\n## ")[0]


def first_cells(text: str) -> list[str]:
    """Return the text in backticks at the beginning of a table's rows."""
    return re.findall(r"^\| `([^`]+)` \|", text, flags=re.MULTILINE)


def test_every_command_is_listed_once() -> None:
    names = re.findall(r"^cmg-mj ([\w-]+)", section("Commands"), flags=re.MULTILINE)
    assert sorted(names) == sorted(cli.commands)


def test_is_one_page() -> None:
    assert len(README.split()) < 2500


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(SNIPPETS)))
def test_a_snippet_runs(number: int, tmp_path: Path) -> None:
    code = SNIPPETS[number]
    process = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
    )
    assert (process.returncode, process.stderr) == (0, "")
    assert bool(process.stdout) == ("print(" in code)


@pytest.mark.slow
@pytest.mark.parametrize("line", dict.fromkeys(COMMANDS + INLINE))
@pytest.mark.usefixtures("elsewhere")
def test_a_command_runs(line: str) -> None:
    """With the README's observer in the current folder, as it says."""
    for code in SNIPPETS:
        if name := re.match(r"# (\w+\.py)\n", code):
            Path(name[1]).write_text(code, encoding="utf-8")
    command, *arguments = shlex.split(line)[1:]
    if command == "replay":
        shutil.copytree(ROOT / "examples" / "data", Path("examples", "data"))
    if command == "mount" or "balanced.toml" in arguments:
        shutil.copytree(ROOT / "examples" / "robots", Path("examples", "robots"))
    if arguments[:1] == ["balanced.toml"]:  # what the line before has written
        (mounting,) = [line for line in COMMANDS if line.startswith("cmg-mj mount ")]
        assert cmg_mj(*shlex.split(mounting)[1:], "--quick").status == 0
    if command == "sweep":
        shutil.copytree(ROOT / "docs" / "studies", Path("docs", "studies"))
    if command in ("export", "plugin") or "board" in arguments:
        pytest.importorskip("casadi")
    if "board" in arguments and (missing_packages := missing()):
        pytest.skip(f"not installed: {', '.join(missing_packages)}")
    if command == "reproduce":
        assert arguments[0] in (*PAPERS, "all", "beyond")
        return
    assert command in CHEAPER, f"{line}: say in CHEAPER how to try it"
    outcome = cmg_mj(command, *arguments, *shlex.split(CHEAPER[command]))
    assert outcome.status == 0, outcome
    assert outcome.out


def test_the_first_command_writes_what_it_says() -> None:
    """The names after it are those of a run's folder, which tests/studies/test_save.py looks into."""
    assert COMMANDS[0] == "cmg-mj run push_recovery"
    for name in ("recording.rrd", "trajectory.parquet", "summary.json", "scenario.toml"):
        assert name in README.split("## ")[0]


def test_the_list_of_commands_is_complete() -> None:
    (block,) = re.findall(r"```text\n(.*?)```", section("Commands"), flags=re.DOTALL)
    options_of = {part.split()[0]: part for part in block.split("cmg-mj ")[1:]}
    help_names = re.findall(r"^  ([\w-]+) ", cmg_mj("--help").out.split("Commands:")[1], flags=re.MULTILINE)
    assert sorted(options_of) == sorted(help_names)
    for command, rest in options_of.items():
        parts = [[command], *([command, part] for part in getattr(cli.commands[command], "commands", ()))]
        help_text = "".join(cmg_mj(*part, "--help").out.split("Options:")[1] for part in parts)
        options = set(re.findall(r"--[\w-]+", help_text)) - {"--help"}
        listed_options = set(re.findall(r"--[\w-]+", rest))
        assert listed_options == options, command


def test_the_tables_are_complete() -> None:
    assert first_cells(section("Which observer, for which robot")) == [*OBSERVERS, *REFERENCES]
    assert sorted(first_cells(section("Commands"))) == sorted(bundled("scenarios"))
    assert sorted(first_cells(section("The papers, claim by claim"))) == sorted(PAPERS)


def test_the_verdicts_are_those_of_the_report() -> None:
    report = (ROOT / "docs" / "reproduced.md").read_text(encoding="utf-8")
    counts = re.search(r"\d+ claims of the papers: [^.]*\.", report)
    assert counts
    sentence = counts[0].rstrip(".").replace("reproduced within", "within")
    assert sentence in README.replace("\n", " ")


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md"])
def test_links_lead_somewhere(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!\w+:|#)([^)#]+)", text):
        assert (ROOT / target).exists(), target
