"""What the commands say and draw on the terminal, and how they hear Ctrl-C."""

from __future__ import annotations

import json
import signal
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import click

from cmg_mj.cli.pace import ProgressRate

if TYPE_CHECKING:
    from cmg_mj.results.run_folder import RunFolder

DONE, WRONG_INPUT, INTERRUPTED = 0, 2, 130
"""Exit statuses."""


class OnProgress(Protocol):
    """Moves a progress bar."""

    def __call__(self, done: float, now: str | None = None) -> None:
        """Show how much is done, and perhaps what is done now."""


class CtrlC:
    """Ctrl-C while something is run and written: the first is noted and acted on by `check`, the second acts at once.

    So a run ends between two ticks, and a file that is being written is finished. What ends a process from outside,
    SIGTERM and, where there is one, SIGHUP, counts as Ctrl-C.

    Attributes:
        noted: Whether there was one.
    """

    def __init__(self) -> None:
        self.noted = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> CtrlC:
        # Where somebody else has a say in a signal (another thread, a job in the background), nothing is changed.
        untouched = {"SIGINT": signal.default_int_handler, "SIGTERM": signal.SIG_DFL, "SIGHUP": signal.SIG_DFL}
        if threading.current_thread() is threading.main_thread():
            for name, handler in untouched.items():
                number = getattr(signal, name, None)  # Windows has no SIGHUP
                if number is not None and signal.getsignal(number) == handler:
                    self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *exception: object) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)

    def _note(self, *signal: Any) -> None:
        if self.noted:
            raise KeyboardInterrupt
        self.noted = True

    def check(self) -> None:
        """Act on what was noted.

        Raises:
            KeyboardInterrupt: There was a Ctrl-C.
        """
        if self.noted:
            raise KeyboardInterrupt


_own_stdout: ContextVar[Any] = ContextVar("standard output")


@contextmanager
def users_code() -> Iterator[None]:
    """While a user's observer may run: what it prints goes to standard error. Standard output is the command's own."""
    token = _own_stdout.set(sys.stdout)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        _own_stdout.reset(token)


def own_stdout() -> Any:
    """Standard output, whatever has been done to it for a user's code."""
    return _own_stdout.get(sys.stdout)


def note(message: str) -> None:
    """One line on standard error, if anybody reads it."""
    with suppress(OSError):
        click.echo(f"cmg-mj: {' '.join(message.split())}", err=True)


def note_hints(hints: Iterable[str]) -> None:
    """What is no mistake and yet likely to make the rig fall, before it does."""
    for hint in hints:
        note(f"hint: {hint}")


def final_path(folder: RunFolder, place: Path) -> str:
    """Where a result is, and why if it is not where the user wanted it."""
    return str(place) if place == folder.path else f"{place}; what {folder.path} has held stays as it was"


def say_written(folder: RunFolder, place: Path, open_it: str, as_json: bool) -> None:
    """Where the files are, and how to open them; with JSON on standard output only what is not as expected."""
    if not as_json or place != folder.path:
        click.echo(f"Written to {final_path(folder, place)}. {open_it}", err=True)


def show(value: Any, table: Any, as_json: bool) -> None:
    """A table, or text, as wide as the terminal allows and as it is where there is none; or the value as JSON."""
    from rich.console import Console

    if as_json or isinstance(table, str):
        click.echo(json.dumps(value, indent=2) if as_json else table, file=own_stdout())
        return
    console = Console(file=own_stdout(), markup=False, highlight=False)  # [rad/s] is a unit
    if console.is_terminal:
        console.print(table)
        return
    console = Console(file=own_stdout(), markup=False, highlight=False, width=1000)
    with console.capture() as captured:
        console.print(table)
    click.echo("\n".join(line.rstrip() for line in captured.get().splitlines()).strip("\n"), file=own_stdout())


@contextmanager
def progress(
    label: str, total: float, ctrl_c: CtrlC | None = None, pace: ProgressRate | None = None
) -> Iterator[OnProgress]:
    """A progress bar on standard error, gone when done; where there is no terminal a line a minute of a pace, or none.

    Args:
        label: What is going on.
        total: How much is to be done.
        ctrl_c: Looked at on every call.
        pace: Says how fast it goes.

    Yields:
        What moves it.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn() if pace is None else TextColumn("{task.fields[pace]}", markup=False),
    )
    bar = Progress(*columns, console=console, transient=True)
    task = bar.add_task(label, total=total, pace="")

    shown = -total

    def on_progress(done: float, now: str | None = None) -> None:
        nonlocal shown
        if ctrl_c is not None:
            ctrl_c.check()
        if pace is not None and not console.is_terminal:
            if line := pace.line(done):
                note(line)
            return
        if now is None and done - shown < total / 2000.0:
            return  # called after every tick, of which one in many is worth drawing
        shown = done
        bar.update(task, completed=done, description=now)  # None leaves the description as it is
        if pace is not None:
            bar.update(task, pace=pace.said(done))

    with bar if console.is_terminal else nullcontext():  # below rich 15, a disabled bar leaves an empty line
        yield on_progress
