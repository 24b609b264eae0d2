"""The commands. What they need is imported when they run, so that --help is quick and Ctrl-C is heard at once."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import click

from cmg_mj.cli import scenarios, studies
from cmg_mj.cli.terminal import DONE, INTERRUPTED, WRONG_INPUT, say
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


class Interruptible(click.Group):
    """Commands that Ctrl-C ends with one line and exit status 130."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            say("interrupted")
            sys.exit(INTERRUPTED)


@click.group(
    cls=Interruptible, help=HELP, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(package_name="cmg_mj", prog_name="cmg-mj")
def cli() -> None:  # noqa: D103  (its help is HELP)
    pass


for command in (
    scenarios.run,
    scenarios.compare,
    scenarios.list_names,
    scenarios.check,
    studies.bench,
    studies.reproduce,
    studies.tune,
):
    cli.add_command(command)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of `cmg-mj`: wrong input ends in one line on standard error and exit status 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a title's letters where the terminal has only ASCII
    if "" not in sys.path:
        sys.path.append("")  # a user's own observer in the current folder; last, so that it can hide nothing
    if not (sys.argv[1:] if arguments is None else arguments):
        click.echo(cli.make_context("cmg-mj", [], resilient_parsing=True).get_help(), err=True)
        sys.exit(WRONG_INPUT)
    try:
        cli.main(args=arguments, prog_name="cmg-mj", standalone_mode=False)
        sys.stdout.flush()
    except (InputError, RunStopped, click.ClickException) as error:
        say(error.format_message() if isinstance(error, click.ClickException) else str(error))
        sys.exit(WRONG_INPUT)
    except (KeyboardInterrupt, click.Abort):  # before or after a command
        say("interrupted")
        sys.exit(INTERRUPTED)
    except OSError as error:
        with suppress(OSError):  # so that Python does not try again to write what it still has
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):  # the reader, such as head, has had enough
            sys.exit(DONE)
        say(f"{error.filename or 'standard output'}: {error.strerror}")
        sys.exit(WRONG_INPUT)
