"""The options that show a run in a viewer while it goes on."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from cmg_mj.cli.arguments import all_of
from cmg_mj.errors import InputError

if TYPE_CHECKING:
    from cmg_mj.results.result import Driver
    from cmg_mj.simulation.experiment import Experiment
    from cmg_mj.studies.live_run import LiveRun

DEFAULT_ADDRESS = "127.0.0.1:9876"
"""Rerun's default address."""


live_options = all_of(
    click.option("--live", is_flag=True, help="Show the run in a rerun viewer as it happens."),
    click.option(
        "--connect",
        metavar="[ADDRESS]",
        is_flag=False,
        flag_value=DEFAULT_ADDRESS,
        help=f"Show the run in a running viewer, at PORT or HOST:PORT.  [default: {DEFAULT_ADDRESS}]",
    ),
    click.option(
        "--pace",
        metavar="FACTOR",
        default="1",
        show_default=True,
        help="Speed with --live or --connect, in multiples of real time; max for no limit.",
    ),
)
"""The options of a run that a viewer can show."""


def factor_of(pace: str) -> float:
    """Parse `--pace` into simulated seconds per second; inf for no limit."""
    if pace == "max":
        return math.inf
    try:
        factor = float(pace)
    except ValueError:
        factor = math.nan
    if not 0.0 <= factor < math.inf:
        raise InputError(f"--pace {pace!r}: must be a number such as 0.5 or 4, or max for no limit")
    return factor or math.inf


def live_run(
    experiment: Experiment,
    live: bool,
    connect: str | None,
    pace: str,
    driver: Driver,
    world: int,
) -> LiveRun | None:
    """Set up the view of a run; None without one.

    Raises:
        InputError: There is no viewer, or the options exclude each other.
    """
    if not live and connect is None:
        if click.get_current_context().get_parameter_source("pace") == ParameterSource.COMMANDLINE:
            raise InputError("--pace: goes with --live or --connect; without a viewer a run goes as fast as it can")
        return None
    if live and connect is not None:
        raise InputError("--live starts a viewer, --connect uses a running one: give one of them")
    factor = factor_of(pace)
    # Rerun reads it when it is imported. The command itself reports a lost viewer at the end.
    os.environ.setdefault("RUST_LOG", "off")
    from cmg_mj.studies.live_run import LiveRun, RealTimeClock
    from cmg_mj.visualization.recording.viewer import require_listening, start_viewer, url_of

    if connect is not None:
        require_listening(connect)
    url = url_of(connect) if connect is not None else start_viewer().url
    return LiveRun(experiment, url, RealTimeClock(factor), driver=driver, world=world)
