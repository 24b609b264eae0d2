"""The commands that measure and study: the bench itself, the papers."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cmg_mj.cli.arguments import names_of, of_observers
from cmg_mj.cli.terminal import INTERRUPTED, CtrlC, progress, say, show
from cmg_mj.errors import InputError, nearest


@click.command(short_help="Time the closed loop against bare MuJoCo.")
@of_observers
@click.option(
    "--worlds", type=click.IntRange(min=1), default=256, show_default=True, metavar="N", help="Worlds of the batch."
)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def bench(observers: str, worlds: int, as_json: bool) -> None:
    """Time the closed loop against bare MuJoCo: microseconds a physics step, and ratios of the same run."""
    from cmg_mj.bench import bench_table, measure

    names = names_of(observers)
    with progress("Bench", 1.0) as on_progress:
        figures = measure(names, worlds, on_progress)
    show(figures, bench_table(figures), as_json)


@click.command(short_help="Reproduce the papers: every figure, table, remark and proof, with a verdict.")
@click.argument("paper")
@click.option("--out", metavar="FOLDER", help="Folder to write to; by default one in runs/.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures alone, as JSON, on standard output.")
def reproduce(paper: str, out: str | None, as_json: bool) -> None:
    """Reproduce PAPER, or all of them: aranovskiy2020, sokolov2019, dao2023, andrieu2009.

    Writes a folder: report.md, its plots, and figures.json. Every claim of the paper stands beside what is obtained
    here, with a verdict: reproduced, reproduced within stated conditions, or not reproduced and why.
    """
    from cmg_mj.reproduce import PAPERS
    from cmg_mj.reproduce import reproduce as obtain
    from cmg_mj.reproduce.write import figures_of, save, verdict_table
    from cmg_mj.runs import output_folder

    if paper not in (*PAPERS, "all"):
        raise InputError(f"{paper!r}: no such paper; {nearest(paper, (*PAPERS, 'all'))}")
    if out == "":
        raise InputError("--out '': name a folder, . for the current one")
    folder = output_folder(Path(out) if out is not None else Path("runs") / f"reproduce-{paper}")
    with CtrlC() as ctrl_c:
        with progress(f"reproduce {paper}", 1.0, ctrl_c) as on_progress:
            entries = obtain(list(PAPERS) if paper == "all" else [paper], lambda now, done: on_progress(done, now))
        save(folder, entries)
        show(figures_of(entries), verdict_table(entries), as_json)
    if not as_json:
        click.echo(f"Written to {folder}. Read {folder / 'report.md'}", err=True)
    if ctrl_c.noted:
        say(f"interrupted; what was obtained until then is in {folder}")
        sys.exit(INTERRUPTED)
