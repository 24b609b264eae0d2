"""The commands that measure speed: of the closed loop, and of an update on a board."""

from __future__ import annotations

import click

from cmg_mj.cli.arguments import json_option, markdown_option, observers_option, worlds_option
from cmg_mj.cli.terminal import progress, show, users_code
from cmg_mj.errors import InputError


@click.group(short_help="Measure the speed of the closed loop or a board.", invoke_without_command=True)
@click.pass_context
def bench(context: click.Context) -> None:
    """Measure the speed of the closed loop, or of an observer's update on a board.

    \b
      cmg-mj bench loop --observers homogeneous,ltv
      cmg-mj bench board
    """  # noqa: D301  (click wants the character itself)
    if context.invoked_subcommand is None:
        raise InputError(f"bench: name what to time: {', '.join(bench.commands)}")


@bench.command(short_help="Time the closed loop against bare MuJoCo.")
@observers_option()
@worlds_option("Worlds of the batch.", default=256)
@json_option()
@users_code()
def loop(observers: list[str], worlds: int, as_json: bool) -> None:
    """Time the closed loop against bare MuJoCo doing the same physics, and an update of each observer."""
    from cmg_mj.studies.benchmark import bench_table, measure

    with progress("Bench", 1.0) as on_progress:
        figures = measure(observers, worlds, on_progress)
    show(figures, bench_table(figures), as_json)


@bench.command(short_help="Count an update's instructions and memory on an emulated Cortex-M7.")
@observers_option()
@markdown_option()
@json_option()
@users_code()
def board(observers: list[str], markdown: bool, as_json: bool) -> None:
    """Count the instructions, stack, memory and flash of an update as C on the papers' processor, a Cortex-M7."""
    from cmg_mj.codegen.board.cost import cost_markdown, cost_scenario, cost_table, measure
    from cmg_mj.simulation.experiment import prepare

    with progress("Bench on the board", 1.0) as on_progress:
        figures = measure([prepare(cost_scenario(name)) for name in observers], on_progress)
    show(figures, cost_markdown(figures) if markdown else cost_table(figures), as_json)
