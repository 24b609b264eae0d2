"""The command that sweeps a scenario over many plants, noises and observers."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cmg_mj.cli.arguments import RunArguments, observers_option, output_path, overwrites, run_options, worlds_option
from cmg_mj.cli.terminal import (
    CtrlC,
    end_interrupted,
    note,
    progress,
    show,
    users_code,
)
from cmg_mj.core.errors import InputError

if TYPE_CHECKING:
    from cmg_mj.features.sweeps.study import SweepStudy


@click.command()
@run_options
@click.option(
    "--vary",
    "varied",
    multiple=True,
    metavar="FIELD=VALUES",
    help="Field and its values: a list (0,0.5,1 or RK4,implicit), a range first:last:count, or a logarithmic range "
    "log:first:last:count. With --sample also low:high. Fields joined by + take the same values. May be "
    "given again: the sweep runs every combination.",
)
@observers_option("the scenario's", baselines=True)
@worlds_option("Worlds of each cell.  [default: 20]")
@click.option(
    "--sample", type=click.IntRange(1), metavar="N", help="Run N points of a quasi-random design instead of a grid."
)
@click.option("--dry-run", is_flag=True, help="Print the number of trials and the time, and run nothing.")
@click.option(
    "--cluster",
    metavar="ADDRESS",
    help="Run on a Dask cluster: its scheduler's address, or local:2 for 2 workers on this machine.",
)
@click.option("--yes", is_flag=True, help="Run the sweep even if it is very large.")
@users_code()
def sweep(
    arguments: RunArguments,
    varied: tuple[str, ...],
    observers: list[str] | None,
    worlds: int | None,
    sample: int | None,
    dry_run: bool,
    cluster: str | None,
    yes: bool,
) -> None:
    """Run SCENARIO, or the study file of a sweep, in many worlds with every observer at every varied value.

    World i has the same noise for every observer and value. An interrupted sweep resumes when the same command runs
    again.

    \b
    Writes a folder:
      trials.parquet  a row for each trial
      cells.parquet   means with 95 % intervals, fall fractions, paired differences to the best
      report.md       the tables, with pictures
      study.toml      reruns the sweep
    """  # noqa: D301  (click wants the character itself)
    from cmg_mj.features.sweeps.cells import COLUMNS, Trials, cells_of
    from cmg_mj.features.sweeps.chunks import Store, estimate_cost
    from cmg_mj.features.sweeps.chunks import run as run_here
    from cmg_mj.features.sweeps.cluster import on_cluster
    from cmg_mj.features.sweeps.report import save, summary
    from cmg_mj.features.sweeps.study import MAX_TRIALS, check_values
    from cmg_mj.scenario.resolve import safe_name

    study = _study(arguments, varied, observers, worlds, sample)
    check_values(study)
    running = nullcontext(run_here) if cluster is None else on_cluster(cluster)
    if dry_run:
        cost = estimate_cost(study)
        text = (
            "{points} points x {observers} observers x {worlds} worlds = {trials} trials in {chunks} chunks; "
            "about {minutes:.2g} min on this machine"
        )
        show(cost, text.format(**cost), arguments.as_json)
        return
    if study.trials > MAX_TRIALS and not yes:
        raise InputError(
            f"{study.n_points} points, {study.trials} trials: for more than {MAX_TRIALS} give --yes "
            "(--dry-run prints the time)"
        )
    path = output_path(arguments.out, f"sweep-{safe_name(Path(arguments.name).stem)}")
    with running as run:
        store = Store.open(path, study, overwrite=overwrites())
        left = store.left()
        if before := study.trials_without(left):
            note(f"resuming: {before} of {study.trials} trials are done")
        with CtrlC() as ctrl_c:
            try:
                with progress(f"sweep {arguments.name}", study.trials, ctrl_c) as on_progress:
                    run(store, left, on_progress)
            except KeyboardInterrupt:
                kept = f"finished trials are kept in {store.folder}, and the same command resumes the sweep"
                end_interrupted(f"interrupted; {kept}")
            trials = Trials(study, store.tables(COLUMNS))
            save(store, trials)
    figures = {"trials": study.trials, "cells": list(cells_of(trials))} if arguments.as_json else {}
    show(figures, summary(trials), arguments.as_json)
    if not arguments.as_json or store.folder != path:
        click.echo(f"Written to {store.folder}. Read {store.folder / 'report.md'}", err=True)


def _study(
    arguments: RunArguments,
    varied: tuple[str, ...],
    observers: list[str] | None,
    worlds: int | None,
    sample: int | None,
) -> SweepStudy:
    """Make the study of the command's options, which precede those of a study file."""
    from cmg_mj.features.sweeps.study import SweepStudy, locate_tracks, parse_axis, read_study
    from cmg_mj.inputs.files import find

    settings = [setting.partition("=") for setting in varied]
    axes = [parse_axis(field, values, f"--vary {field}{equals}{values}") for field, equals, values in settings]
    file = read_study(arguments.name)
    where = f"{arguments.name}: vary."
    axes = axes or [parse_axis(field, values, where + field) for field, values in file.vary.items()]
    if isinstance(file.scenario, str):
        scenario = replace(arguments, name=file.scenario).scenario()
    else:
        scenario = arguments.scenario(fields=file.scenario)
    beside = find("scenarios", arguments.name, ".toml", "scenario").parent
    return SweepStudy(
        scenario,
        tuple(locate_tracks(axis, beside) for axis in axes),
        tuple(observers or file.sweep.observers or [scenario.observer.kind]),
        worlds or file.sweep.worlds,
        sample or file.sweep.points,
    )
