"""The command that sweeps: a scenario on many rigs, at many noises, with many observers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cmg_mj.cli.arguments import MOST_WORLDS, RunArguments, claim_folder, named_observers, output_path, run_options
from cmg_mj.cli.pace import ProgressRate, in_time
from cmg_mj.cli.terminal import INTERRUPTED, CtrlC, note, progress, say_written, show, users_code
from cmg_mj.errors import InputError

if TYPE_CHECKING:
    from cmg_mj.studies.sweeps.plan import Cost
    from cmg_mj.studies.sweeps.report import SweepTables
    from cmg_mj.studies.sweeps.study import SweepStudy


@click.command(short_help="Vary fields over many worlds: every observer, with intervals.")
@run_options
@click.option(
    "--vary",
    "varied",
    multiple=True,
    metavar="FIELD=VALUES",
    help="A field and its values: a list 0,0.5,1, also of words such as RK4,implicit; a range first:last:count, a"
    " logarithmic one log:first:last:count; without a count, low:high, only with --sample or --sobol. Fields with +"
    " between take the same values together. May be given again: every combination is run.",
)
@click.option("--observers", metavar="NAMES", help="Names with commas between, or all.  [default: the scenario's own]")
@click.option("--worlds", type=click.IntRange(1, MOST_WORLDS), metavar="N", help="Worlds a cell.  [default: 20]")
@click.option(
    "--sample", type=click.IntRange(1), metavar="N", help="N points of a quasi-random design of the ranges and lists."
)
@click.option("--sobol", type=click.IntRange(1), metavar="N", help="A design for Sobol indices, N a power of two.")
@click.option("--order", metavar="NAMES", help="Observers, the best first: count how often that holds.")
@click.option("--plan", is_flag=True, help="Say what it would take, and run nothing.")
@click.option(
    "--cluster",
    metavar="ADDRESS",
    help="Compute on a Dask cluster: its scheduler's address, or local:2 for one of 2 workers on this machine.",
)
@click.option("--yes", is_flag=True, help="Run it even if it is very large.")
@users_code()
def sweep(
    arguments: RunArguments,
    varied: tuple[str, ...],
    observers: str | None,
    worlds: int | None,
    sample: int | None,
    sobol: int | None,
    order: str | None,
    plan: bool,
    cluster: str | None,
    yes: bool,
) -> None:
    """Run SCENARIO, or a study file that a sweep has written, in every cell: every point with every observer.

    World i has the same noise in every cell. Writes a folder: trials.parquet (a row a trial), cells.parquet (means with
    95 % intervals, shares of falls, paired differences to the best), report.md with pictures, and study.toml, which
    reruns. The same command again goes on where it was stopped.
    """
    from cmg_mj.studies.sweeps.cells import COLUMNS, Trials
    from cmg_mj.studies.sweeps.chunk_store import Store
    from cmg_mj.studies.sweeps.plan import estimate_cost
    from cmg_mj.studies.sweeps.report import FILES, save, summary, tables_of
    from cmg_mj.studies.sweeps.study import MOST_TRIALS, check_values, counted

    if cluster is not None:
        from cmg_mj.studies.sweeps.dask_cluster import local_workers

        local_workers(cluster)
    study = _study(arguments, varied, observers, worlds, sample, sobol, order)
    check_values(study)
    if plan:
        takes = estimate_cost(study)
        show(takes, _plan_text(takes), arguments.as_json)
        return
    if study.trials > MOST_TRIALS and not yes:
        raise InputError(
            f"{study.cells} cells of {counted(study.worlds, 'world')}: {study.trials} trials; beyond {MOST_TRIALS} say "
            "--yes (--plan says what it would take)"
        )
    place = Path("runs") / f"sweep-{Path(arguments.name).stem}" if arguments.out is None else output_path(arguments.out)
    with _runner(cluster) as run:
        folder = claim_folder(place, FILES)
        store = Store(place, study)
        before = store.open()
        if before:
            note(f"{before} of {study.trials} trials are there from before")
        with CtrlC() as ctrl_c:
            try:
                pace = ProgressRate("trials", study.trials, before)
                with progress(f"sweep {arguments.name}", study.trials, ctrl_c, pace) as on_progress:
                    run(store, on_progress)
            except KeyboardInterrupt:
                note(f"interrupted; what is finished is kept in {place}, and the same command goes on from there")
                sys.exit(INTERRUPTED)
            found = tables_of(Trials(study, store.tables(COLUMNS)))
            at = save(folder, store, found)
    show(_as_json(found) if arguments.as_json else None, summary(found), arguments.as_json)
    say_written(folder, at, f"Read {at / 'report.md'}", arguments.as_json)


@contextmanager
def _runner(cluster: str | None) -> Iterator[Callable[..., None]]:
    """What runs the chunks: this process, or a cluster."""
    if cluster is None:
        from cmg_mj.studies.sweeps.chunk_store import run

        yield run
    else:
        from cmg_mj.studies.sweeps.dask_cluster import on_cluster

        with on_cluster(cluster, note) as connected:
            yield connected.run


def _study(
    arguments: RunArguments,
    varied: tuple[str, ...],
    observers: str | None,
    worlds: int | None,
    sample: int | None,
    sobol: int | None,
    order: str | None,
) -> SweepStudy:
    from cmg_mj.studies.sweeps.api import WORLDS
    from cmg_mj.studies.sweeps.axes import parse_axis
    from cmg_mj.studies.sweeps.file import SweepFields, axes_of, design_of, scenario_of, study_file
    from cmg_mj.studies.sweeps.study import SweepStudy

    if sample is not None and sobol is not None:
        raise InputError("--sample and --sobol: one of them")
    axes = [parse_axis(*_split(setting), f"--vary {setting}") for setting in varied]
    fields = study_file(arguments.name)
    asked: SweepFields = {}
    if fields is None:
        scenario = arguments.scenario()
    else:
        scenario = scenario_of(arguments.name, fields, arguments.settings)
        if arguments.seed is not None:
            scenario = scenario.model_copy(update={"seed": arguments.seed})
        asked = fields.get("sweep", {})
        axes = axes or axes_of(arguments.name, fields)
    design, n = design_of(arguments.name, asked)
    if sample is not None or sobol is not None:
        design, n = ("sample", sample or 0) if sample is not None else ("sobol", sobol or 0)
    names = asked.get("observers", [scenario.observer.kind])
    if observers is not None:
        names = named_observers(observers)
    expected = asked.get("order", []) if order is None else [name.strip() for name in order.split(",")]
    of_each = worlds or asked.get("worlds", WORLDS)
    return SweepStudy(scenario, tuple(axes), tuple(names), of_each, design, n, tuple(expected))


def _split(setting: str) -> tuple[str, str]:
    field, _, values = setting.partition("=")
    return field.strip(), values


def _as_json(found: SweepTables) -> dict[str, Any]:
    from cmg_mj.studies.sweeps.cells import cells_of
    from cmg_mj.studies.sweeps.order import order_rows

    study = found.trials.study
    tables: dict[str, Any] = {"trials": study.trials, "cells": list(cells_of(found.trials))}
    if study.order:
        tables["order"] = order_rows(study, found.order)
    if study.design == "sobol":
        tables["indices"] = [row._asdict() for row in found.indices]
    return tables


def _plan_text(takes: Cost) -> str:
    from cmg_mj.studies.sweeps.study import counted

    how_many = " x ".join(counted(takes[what], what[:-1]) for what in ("points", "observers", "worlds"))
    seconds, chunks = takes["minutes"] * 60.0, counted(takes["chunks"], "chunk")
    how_long = f"{seconds:.2g} s" if seconds < 10.0 else in_time(seconds)
    return (
        f"{how_many} = {counted(takes['trials'], 'trial')} in {chunks}; about {how_long} on this machine, "
        f"{takes['memory_mb']:.0f} MB"
    )
