"""The commands. What they need is imported when they run, so that --help is quick and Ctrl-C is heard at once."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import click

from cmg_mj.cli import bench, boards, logs, mount, reproduce, scenarios, studio, sweeps, tune
from cmg_mj.cli.terminal import DONE, INTERRUPTED, WRONG_INPUT, note
from cmg_mj.errors import InputError, RunStopped

HELP = """A bench for gyroscopic stabilisation: a six-body scissored pair, real sensors, velocity observers.

A scenario is named by a bundled one's name (cmg-mj list scenarios) or by the path of a TOML file.

\b
  cmg-mj run push_recovery
  cmg-mj run push_recovery --observer ltv --set plant.equilibrium_bias_deg=1.0 --seed 3
  cmg-mj compare push_recovery --observers all
  rerun runs/push_recovery-homogeneous-0/recording.rrd

Ctrl-C ends a run early and keeps what was recorded; a second one ends it at once.

Exit status: 0 done (a fall is a result), 2 the input is wrong or a run could not go on, 130 interrupted.
"""


class Commands(click.Group):
    """Commands that Ctrl-C ends with one line and exit status 130, and whose output nobody has to read."""

    def make_context(self, *arguments: Any, **others: Any) -> click.Context:
        """Read the arguments, which prints what --help asks for."""
        with _ignore_broken_pipe():
            return super().make_context(*arguments, **others)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            with _ignore_broken_pipe():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            note("interrupted")
            sys.exit(INTERRUPTED)


@contextmanager
def _ignore_broken_pipe() -> Iterator[None]:
    """A reader, such as head, who has had enough is no failure; to click it is one."""
    try:
        yield
    except BrokenPipeError as error:
        raise click.exceptions.Exit(DONE) from error


@click.group(
    cls=Commands, help=HELP, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(package_name="cmg_mj", prog_name="cmg-mj")
def cli() -> None:  # noqa: D103  (its help is HELP)
    pass


for command in (
    scenarios.run,
    scenarios.compare,
    scenarios.list_names,
    scenarios.check,
    studio.studio,
    sweeps.sweep,
    bench.bench,
    reproduce.reproduce,
    tune.tune,
    tune.tune_log,
    logs.replay,
    boards.export,
    mount.mount,
):
    cli.add_command(command)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of `cmg-mj`: wrong input ends in one line on standard error and exit status 2."""
    _open_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a title's letters where the terminal has only ASCII
    if "" not in sys.path:
        sys.path.append("")  # a user's own observer in the current folder; last, so that it can hide nothing
    status: Any = DONE
    try:
        status = _status(sys.argv[1:] if arguments is None else arguments)
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
    except OSError as error:
        if not isinstance(error, BrokenPipeError):  # the reader, such as head, has had enough
            status = WRONG_INPUT
        _detach_streams(error)
    if status != DONE:
        sys.exit(status)


def _status(arguments: Sequence[str]) -> Any:
    """Run a command: its exit status. What is wrong is said."""
    if not arguments:
        click.echo(cli.make_context("cmg-mj", [], resilient_parsing=True).get_help(), err=True)
        return WRONG_INPUT
    try:
        cli.main(args=list(arguments), prog_name="cmg-mj", standalone_mode=False)
    except SystemExit as exit:
        return exit.code
    except (InputError, RunStopped, click.ClickException) as error:
        return _fail_with(
            error.format_message() if isinstance(error, click.ClickException) else str(error), WRONG_INPUT
        )
    except MemoryError:
        return _fail_with("there is not enough memory for this; take a shorter run or fewer worlds", WRONG_INPUT)
    except (KeyboardInterrupt, click.Abort):  # before or after a command
        return _fail_with("interrupted", INTERRUPTED)
    return DONE


def _open_streams() -> None:
    """What a shell has closed (`>&-`) takes all and shows nothing; else the next file written would get its number."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode, encoding="utf-8"))


def _fail_with(complaint: str, status: int) -> int:
    """The status, whether anyone has read the complaint or not."""
    with suppress(BrokenPipeError):
        note(complaint)
    return status


def _detach_streams(error: OSError) -> None:
    """Nothing more is written to a stream that takes nothing, by Python at its end either; say why if that can be."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            with suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    if not isinstance(error, BrokenPipeError):
        nameless = "the current folder" if isinstance(error, FileNotFoundError) else "standard output"
        note(f"{error.filename or nameless}: {error.strerror}")
