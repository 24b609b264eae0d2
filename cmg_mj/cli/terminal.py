"""Output of the commands on the terminal, progress included, and their handling of Ctrl-C."""

from __future__ import annotations

import json
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from contextvars import ContextVar
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

import click

from cmg_mj.core.errors import shortened

if TYPE_CHECKING:
    from rich.console import RenderableType

    from cmg_mj.results.folder import RunFolder

DONE, WRONG_INPUT, INTERRUPTED = 0, 2, 130
"""Exit statuses."""
MAX_LINE, MAX_WORD = 4000, 400
"""Characters of a message, and of a word in it, such as a path."""


class CtrlC:
    """Handles Ctrl-C while a command runs and writes: `check` acts on the first one, the second one acts at once.

    A run ends between two ticks, and a file that is being written is finished. SIGTERM and, where it exists, SIGHUP
    count as Ctrl-C.

    Attributes:
        noted: Whether there was a Ctrl-C.
    """

    def __init__(self) -> None:
        self.noted = False
        self._replaced: list[tuple[int, Any]] = []

    def __enter__(self) -> CtrlC:
        # Signals that somebody else handles (another thread, a job in the background) stay as they are.
        if threading.current_thread() is threading.main_thread():
            for name in ("SIGINT", "SIGTERM", "SIGHUP"):
                number = getattr(signal, name, None)  # Windows has no SIGHUP
                if number and signal.getsignal(number) in (signal.default_int_handler, signal.SIG_DFL):
                    self._replaced.append((number, signal.signal(number, self._note)))
        return self

    def __exit__(self, *exception: object) -> None:
        for number, handler in self._replaced:
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.noted:
            raise KeyboardInterrupt
        self.noted = True

    def check(self) -> None:
        """Act on a Ctrl-C.

        Raises:
            KeyboardInterrupt: There was a Ctrl-C.
        """
        if self.noted:
            raise KeyboardInterrupt


_command_stdout: ContextVar[TextIO] = ContextVar("standard output")


@contextmanager
def users_code() -> Iterator[None]:
    """Send what a user's code prints to standard error; standard output is for the command alone."""
    token = _command_stdout.set(sys.stdout)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        _command_stdout.reset(token)


def own_stdout() -> TextIO:
    """Return standard output, also within `users_code`."""
    return _command_stdout.get(sys.stdout)


def note(message: str) -> None:
    """Write one line to standard error, if it is read; of a very long message its beginning."""
    with suppress(OSError):
        words = " ".join(shortened(word, MAX_WORD) for word in message.split())
        click.echo(f"cmg-mj: {shortened(words, MAX_LINE)}", err=True)


def note_hints(hints: Iterable[str]) -> None:
    """Write hints: settings that are no mistake but likely to make the plant fall."""
    for hint in hints:
        note(f"hint: {hint}")


def end_interrupted(message: str) -> NoReturn:
    """Say what there is after a Ctrl-C, and end with the exit status for one."""
    note(message)
    sys.exit(INTERRUPTED)


def final_path(folder: RunFolder, place: Path) -> str:
    """Return the path of a result, with the reason if it is not the requested folder."""
    return str(place) if place == folder.path else f"{place}; what was in {folder.path} stays as it was"


def shell_command(*words: str | Path) -> str:
    """Return a command as a shell takes it, with quotes where a word needs them."""
    return shlex.join(map(str, words))


def open_recording(place: Path) -> str:
    """Say how the recording in a folder is opened."""
    return f"Open the recording: {shell_command('rerun', place / 'recording.rrd')}"


def say_written(folder: RunFolder, place: Path, open_it: str, as_json: bool) -> None:
    """Write the path of the files and how to open them; with JSON only if the path is not the expected one."""
    if not as_json or place != folder.path:
        click.echo(f"Written to {final_path(folder, place)}. {open_it}", err=True)


def show(value: Any, table: RenderableType, as_json: bool) -> None:
    """Print a value as JSON, or a table (or text) as wide as the terminal; in full width without a terminal."""
    from rich.console import Console

    if as_json:
        table = json.dumps(value, indent=2)
    elif not isinstance(table, str):
        console = Console(file=own_stdout(), markup=False, highlight=False)  # [rad/s] is a unit
        if not console.is_terminal:
            console.width = 1000
        with console.capture() as captured:
            console.print(table)
        table = "\n".join(line.rstrip() for line in captured.get().splitlines()).strip("\n")
    click.echo(table, file=own_stdout())


@contextmanager
def progress(label: str, total: float, ctrl_c: CtrlC | None = None) -> Iterator[Callable[..., None]]:
    """Show a progress bar on standard error until the end.

    Args:
        label: Description of the task.
        total: Total of the progress.
        ctrl_c: Checked on every call.

    Yields:
        Function of how much is done, and perhaps of the current part, that moves the bar.
    """
    from rich.console import Console
    from rich.progress import Progress, TextColumn

    console = Console(stderr=True)
    _, *columns = Progress.get_default_columns()
    bar = Progress(TextColumn("{task.description}", markup=False), *columns, console=console, transient=True)
    task = bar.add_task(label, total=total)

    position = -total

    def on_progress(done: float, now: str | None = None) -> None:
        nonlocal position
        if ctrl_c is not None:
            ctrl_c.check()
        if now is None and done - position < total / 2000.0:
            return  # called after every tick, of which one in many is worth drawing
        position = done
        bar.update(task, completed=done, description=now)  # None leaves the description as it is

    with bar if console.is_terminal else nullcontext():  # below rich 15, a disabled bar leaves an empty line
        yield on_progress
