"""The commands that time the closed loop, an update on a board, and chunks of sweeps."""

from __future__ import annotations

import click

from cmg_mj.cli.arguments import MOST_WORLDS, names_of, with_json, with_observers
from cmg_mj.cli.terminal import progress, show, users_code
from cmg_mj.errors import InputError

BATCH_WORLDS, CHUNK_WORLDS = 256, 512
"""Default worlds of a timed batch, and of a sweep's chunk."""


@click.group(short_help="Time the closed loop, an update on a board, or chunks of sweeps.", invoke_without_command=True)
@click.pass_context
def bench(context: click.Context) -> None:
    """Time the closed loop, an update on a board, or chunks of sweeps.

    \b
      cmg-mj bench loop --observers homogeneous,ltv
      cmg-mj bench board
    """  # noqa: D301  (click wants the character itself)
    if context.invoked_subcommand is None:
        raise InputError(f"bench: name what to time: {', '.join(bench.commands)}")


@bench.command(short_help="Time the closed loop against bare MuJoCo.")
@with_observers
@click.option(
    "--worlds",
    type=click.IntRange(1, MOST_WORLDS),
    default=BATCH_WORLDS,
    show_default=True,
    metavar="N",
    help="Worlds of the batch.",
)
@with_json
@users_code()
def loop(observers: str, worlds: int, as_json: bool) -> None:
    """Time the closed loop against bare MuJoCo doing the same physics, and an update of each observer."""
    from cmg_mj.studies.benchmark import bench_table, measure

    names = names_of(observers)
    with progress("Bench", 1.0) as on_progress:
        figures = measure(names, worlds, on_progress)
    show(figures, bench_table(figures), as_json)


@bench.command(short_help="Count an update's instructions and memory on an emulated Cortex-M7.")
@with_observers
@click.option("--markdown", is_flag=True, help="Print the table as Markdown.")
@with_json
@users_code()
def board(observers: str, markdown: bool, as_json: bool) -> None:
    """Count the instructions, stack, memory and flash of an update as C on the papers' processor, a Cortex-M7."""
    from cmg_mj.codegen.board.cost import cost_markdown, cost_scenario, cost_table, measure
    from cmg_mj.simulation.experiment import prepare

    names = names_of(observers)
    with progress("Bench on the board", 1.0) as on_progress:
        figures = measure([prepare(cost_scenario(name)) for name in names], on_progress)
    show(figures, cost_markdown(figures) if markdown else cost_table(figures), as_json)


@bench.command(short_help="Time chunks of sweeps.")
@with_observers
@click.option(
    "--worlds",
    type=click.IntRange(1, MOST_WORLDS),
    default=CHUNK_WORLDS,
    show_default=True,
    metavar="N",
    help="Worlds of a chunk.",
)
@with_json
@users_code()
def sweep(observers: str, worlds: int, as_json: bool) -> None:
    """Time chunks of sweeps: processor time of a whole trial, against that of MuJoCo's batch alone."""
    from cmg_mj.studies.sweeps.cost import measure, table

    names = names_of(observers)
    with progress("Bench of sweeps", 1.0) as on_progress:
        figures = measure(names, worlds, on_progress)
    show(figures, table(figures), as_json)
