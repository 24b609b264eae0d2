"""The command that measures the speed of plugins."""

from __future__ import annotations

import os

import click

from cmg_mj.cli.arguments import json_option, observers_option, worlds_option
from cmg_mj.cli.terminal import progress, show, users_code
from cmg_mj.errors import InputError


@click.group(short_help="Measure the speed of plugins.", invoke_without_command=True)
@click.pass_context
def bench(context: click.Context) -> None:
    """Measure the speed of plugins.

    \b
      cmg-mj bench plugin --observers gyro_free
    """  # noqa: D301  (click wants the character itself)
    if context.invoked_subcommand is None:
        raise InputError(f"bench: name what to time: {', '.join(bench.commands)}")


@bench.command(short_help="Time MuJoCo with a plugin against the same model without.")
@observers_option()
@worlds_option("Worlds of rollout and Batch.", default=64)
@json_option()
@users_code()
def plugin(observers: list[str], worlds: int, as_json: bool) -> None:
    """Time MuJoCo with the controller as a plugin against the same model without: processor time, in pairs."""
    from cmg_mj.scenario.loading import load_scenario
    from cmg_mj.simulation.experiment import prepare
    from cmg_mj.simulation.plugin_files import find_tools
    from cmg_mj.studies.plugin_benchmark import measure, plugin_table

    find_tools()
    experiments = [prepare(load_scenario("push_recovery", ["open_loop_observers=[]"], name)) for name in observers]
    with progress("Bench of plugins", 1.0 * len(observers)) as on_progress:
        figures = [
            measure(experiment, worlds, os.cpu_count() or 1, lambda share, i=i: on_progress(i + share))
            for i, experiment in enumerate(experiments)
        ]
    show(figures, "\n\n".join(map(plugin_table, figures)), as_json)
