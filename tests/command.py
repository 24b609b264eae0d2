"""Running the command `cmg-mj`, in this process and in one of its own."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from cmg_mj.cli import main

COMMAND = [sys.executable, "-c", "import sys; from cmg_mj.cli import main; main(sys.argv[1:])"]
ROOT = Path(__file__).resolve().parent.parent
HANGS_AFTER_S = 900.0
"""A process that takes a second or two and has not come back by then never will, however busy the machine."""


@dataclass(frozen=True)
class CommandOutcome:
    """The outcome of a command: its exit status and its output."""

    status: int
    out: str
    err: str

    @property
    def complaint(self) -> str:
        """The one line that tells what is wrong; fails if it is anything else."""
        assert self.status == 2, self
        assert self.out == "", self
        (line,) = self.err.splitlines()
        assert line.startswith("cmg-mj: "), line
        for jargon in (
            "Traceback",
            "nput should",
            "Value error",
            "dictionary",
            "type=",
            "validation",
            "pydantic",
            "\x1b",
        ):
            assert jargon not in line
        return line.removeprefix("cmg-mj: ")


def cmg_mj(*arguments: object) -> CommandOutcome:
    """Run the command in this process. An exception that is no exit is a traceback to the user, and fails the test."""
    out, err = io.StringIO(), io.StringIO()
    status: object = 0
    with redirect_stdout(out), redirect_stderr(err):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as exit:
            status = exit.code
    assert isinstance(status, int)
    return CommandOutcome(status, out.getvalue(), err.getvalue())


def environment(**variables: str) -> dict[str, str]:
    """The environment for a process of its own: without colours, with the tests' package importable."""
    inherited = {
        name: value for name, value in os.environ.items() if name not in ("FORCE_COLOR", "COLUMNS", "PYTHONPATH")
    }
    return {**inherited, "PYTHONPATH": str(ROOT), "TERM": "xterm", **variables}


def cmg_mj_process(*arguments: object, cwd: Path) -> CommandOutcome:
    """Run the command in a process of its own."""
    process = subprocess.run(
        [*COMMAND, *map(str, arguments)],
        cwd=cwd,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
    )
    return CommandOutcome(process.returncode, process.stdout, process.stderr)
