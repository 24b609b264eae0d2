"""The commands: the core's own and those of the features. Each is imported when it is called."""

from __future__ import annotations

import gc
import io
import os
import pkgutil
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, ClassVar

import click

from cmg_mj.cli.terminal import DONE, INTERRUPTED, WRONG_INPUT, note
from cmg_mj.core.errors import InputError, RunStopped, raised
from cmg_mj.inputs.features import COMMANDS, Command

OBJECTS_A_COLLECTION = 50_000
"""New objects after which Python looks for cycles. Imports make many objects and few cycles: Python's default of 700
makes a short run slower."""
HELP = """A bench for gyroscopic stabilisation: a six-body scissored pair, realistic sensors, velocity observers.

A scenario is the name of a bundled scenario (cmg-mj list scenarios) or the path of a TOML file.

\b
  cmg-mj run push_recovery
  cmg-mj run push_recovery --observer ltv --set plant.equilibrium_bias_deg=1.0 --seed 3
  cmg-mj compare push_recovery --observers all
  rerun runs/push_recovery-homogeneous-0/recording.rrd

Ctrl-C ends a run early and keeps its results; a second Ctrl-C ends it at once.

Exit status: 0 done (also if the plant fell), 2 wrong input or a run that could not continue, 130 interrupted.
"""


OWN = {
    "run": Command("cmg_mj.cli.scenarios:run", "Run a scenario: summary, trajectory, rerun recording."),
    "compare": Command("cmg_mj.cli.scenarios:compare", "Run several observers on the same plant, pushes and noise."),
    "list": Command(
        "cmg_mj.cli.scenarios:list_names", "List the bundled scenarios, the observers and the control laws."
    ),
    "check": Command("cmg_mj.cli.scenarios:check", "Check a scenario file, or a model file, without running it."),
}
"""The commands that are no feature's."""


class Commands(click.Group):
    """The commands, each of which is imported when it is called."""

    table: ClassVar = {**OWN, **COMMANDS}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the commands' names."""
        return list(self.table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command; None if there is none of this name."""
        return pkgutil.resolve_name(self.table[cmd_name].entry) if cmd_name in self.table else None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the table of commands, without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.help) for name, command in self.table.items()])


@click.group(
    cls=Commands, help=HELP, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(package_name="cmg_mj", prog_name="cmg-mj")
def cli() -> None:  # noqa: D103  (its help is HELP)
    pass


def main(arguments: Sequence[str] | None = None) -> None:
    """Run `cmg-mj`; wrong input ends in one line on standard error and exit status 2."""
    _open_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a title's letters where the terminal has only ASCII
    if "" not in sys.path:
        sys.path.append("")  # a user's own observer in the current folder; last, so that it can hide nothing
    status = DONE
    gc.set_threshold(OBJECTS_A_COLLECTION)
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
    """Run a command, print its error if there is one, and return its exit status."""
    if "_CMG_MJ_COMPLETE" in os.environ:  # a shell asks for completions
        cli.main(prog_name="cmg-mj")
    if not arguments:
        click.echo(cli.make_context("cmg-mj", [], resilient_parsing=True).get_help(), err=True)
        return WRONG_INPUT
    status = WRONG_INPUT
    try:
        with cli.make_context("cmg-mj", list(arguments)) as context:
            cli.invoke(context)
        return DONE
    except click.exceptions.Exit as error:
        return error.exit_code
    except click.ClickException as error:
        message = error.format_message()
    except (InputError, RunStopped) as error:
        message = str(error)
    except MemoryError:
        message = "there is not enough memory for this; take a shorter run or fewer worlds"
    except KeyboardInterrupt:
        message, status = "interrupted", INTERRUPTED
    except BaseException as error:
        from cmg_mj.inputs.users_line import users_line

        line = users_line(error.__traceback__)
        if line is None and isinstance(error, SystemExit):
            return error.code
        if line is None and "MUJOCO_GL" not in str(error):
            raise
        # By a user's own code where nobody expects it to run, or by the import of MuJoCo.
        message = f"{line}: raised {raised(error)}" if line else f"{error}: unset it, or take egl, glfw or osmesa"
    note(message)
    return status


def _open_streams() -> None:
    """Open null devices for streams that the shell closed (`>&-`); else the next file would get their number."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115  (open to the end)


def _detach_streams(error: OSError) -> None:
    """Redirect streams that cannot be written to the null device, and print why if possible."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            with suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    if not isinstance(error, BrokenPipeError):
        default = "the current folder" if isinstance(error, FileNotFoundError) else "standard output"
        note(f"{error.filename or default}: {error.strerror}")
