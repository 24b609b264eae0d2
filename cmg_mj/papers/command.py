"""The command that reproduces the papers."""

from __future__ import annotations

import click

from cmg_mj.cli.arguments import claim_output, json_option, out_option
from cmg_mj.cli.terminal import CtrlC, end_interrupted, final_path, progress, say_written, show
from cmg_mj.core.errors import InputError, nearest


@click.command(short_help="Reproduce the four papers, claim by claim, with verdicts.")
@click.argument("paper")
@out_option()
@json_option()
def reproduce(paper: str, out: str | None, as_json: bool) -> None:
    """Reproduce PAPER (aranovskiy2020, sokolov2019, dao2023, andrieu2009), or all of them.

    Writes a folder: report.md, its plots, and figures.json. The report compares every claim of the paper with the
    figures obtained here. One rule decides the verdict of a claim:

    \b
      reproduced                it holds; the paper prints all it depends on
      within stated conditions  it holds, with an assumption of ours (push, noise)
      illustrated               a general statement, tried on some systems
      cannot be tested          the paper does not give its data
      not reproduced            otherwise, with the reason

    The exit status is 0 whatever the verdicts are.
    """  # noqa: D301  (click wants the character itself)
    from cmg_mj.papers import PAPERS, check_installed
    from cmg_mj.papers import reproduce as reproduce_papers
    from cmg_mj.papers.report import figures_of, save_report, verdict_table

    names = (*PAPERS, "all")
    if paper not in names:
        raise InputError(f"{paper!r}: no such paper; {nearest(paper, names)}")
    papers = list(PAPERS) if paper == "all" else [paper]
    check_installed(papers)  # before a folder is made
    folder = claim_output(out, f"reproduce-{paper}")
    with CtrlC() as ctrl_c:
        with progress(f"reproduce {paper}", 1.0, ctrl_c) as on_progress:
            entries = reproduce_papers(papers, lambda now, done: on_progress(done, now))
        place = save_report(folder, entries)
        show(figures_of(entries), verdict_table(entries), as_json)
    say_written(folder, place, f"Read {place / 'report.md'}", as_json)
    if ctrl_c.noted:
        end_interrupted(f"interrupted; what was obtained until then is in {final_path(folder, place)}")
