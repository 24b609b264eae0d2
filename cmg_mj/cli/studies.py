"""The commands that measure and study: the bench itself, an observer's parameters, the papers."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import click

from cmg_mj.cli.arguments import (
    MOST_WORLDS,
    RunArguments,
    check_observer,
    claim_folder,
    names_of,
    of_observers,
    output_path,
    refuse_given,
    run_options,
)
from cmg_mj.cli.logs import READING, LogArguments, each_once, of_a_log
from cmg_mj.cli.terminal import INTERRUPTED, CtrlC, final_path, note, progress, say_written, show, users_code
from cmg_mj.errors import InputError, nearest
from cmg_mj.scenario.differences import safe_name

BATCH, CHUNK = 256, 512
"""Worlds that are timed at once: of a batch, and of a sweep's chunk."""


@click.command(short_help="Time the closed loop against bare MuJoCo.")
@of_observers
@click.option(
    "--worlds",
    type=click.IntRange(1, MOST_WORLDS),
    metavar="N",
    help=f"Worlds of the batch.  [default: {BATCH}]",
)
@click.option("--board", is_flag=True, help="Count what an update takes on an emulated Cortex-M7 instead.")
@click.option("--sweep", is_flag=True, help="Time chunks of sweeps instead: processor time of all by the batch's.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
@click.option("--markdown", is_flag=True, help="Print the table of --board as Markdown.")
@users_code()
def bench(observers: str, worlds: int | None, board: bool, sweep: bool, as_json: bool, markdown: bool) -> None:
    """Time the closed loop against bare MuJoCo doing the same physics, and an update of each observer.

    With --board: instructions, stack, memory and flash of an update as C on the papers' processor.
    """
    names = names_of(observers)
    if board and sweep:
        raise InputError("--board and --sweep: one of them")
    if board:
        if worlds is not None:
            raise InputError("--worlds: is for the batch on the host; --board has no worlds")
        from cmg_mj.codegen.board.cost import cost_markdown, cost_scenario, cost_table
        from cmg_mj.codegen.board.cost import measure as count
        from cmg_mj.simulation.experiment import prepare

        with progress("Bench on the board", 1.0) as on_progress:
            figures = count([prepare(cost_scenario(name)) for name in names], on_progress)
        show(figures, cost_markdown(figures) if markdown else cost_table(figures), as_json)
        return
    if markdown:
        raise InputError("--markdown: only the table of --board is printed so")
    if sweep:
        from cmg_mj.studies.sweeps.cost import measure as chunks
        from cmg_mj.studies.sweeps.cost import table

        with progress("Bench of sweeps", 1.0) as on_progress:
            figures = chunks(names, worlds or CHUNK, on_progress)
        show(figures, table(figures), as_json)
        return
    from cmg_mj.studies.benchmark import bench_table, measure

    with progress("Bench", 1.0) as on_progress:
        figures = measure(names, worlds or BATCH, on_progress)
    show(figures, bench_table(figures), as_json)


@click.command(short_help="Reproduce the four papers, claim by claim, with verdicts.")
@click.argument("paper")
@click.option("--out", metavar="FOLDER", help="Folder to write to; by default one in runs/.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures alone, as JSON, on standard output.")
def reproduce(paper: str, out: str | None, as_json: bool) -> None:
    """Reproduce PAPER, or all of them: aranovskiy2020, sokolov2019, dao2023, andrieu2009.

    And beyond, which is in none of them and takes some minutes: every observer, 100 seeds each, in one table.

    Writes a folder: report.md, its plots, and figures.json. Every claim of the paper stands beside what is obtained
    here, with a verdict: reproduced, reproduced within stated conditions, or not reproduced and why.
    """
    from cmg_mj.papers import BEYOND, PAPERS, check_installed
    from cmg_mj.papers import reproduce as obtain
    from cmg_mj.papers.report import REPORT_FILES, figures_of, save_report, verdict_table

    names = (*PAPERS, *BEYOND, "all")
    if paper not in names:
        raise InputError(f"{paper!r}: no such paper; {nearest(paper, names)}")
    papers = list(PAPERS) if paper == "all" else [paper]
    check_installed(papers)  # before a folder is made
    folder = claim_folder(output_path(out) if out is not None else Path("runs") / f"reproduce-{paper}", REPORT_FILES)
    with CtrlC() as ctrl_c:
        with progress(f"reproduce {paper}", 1.0, ctrl_c) as on_progress:
            entries = obtain(papers, lambda now, done: on_progress(done, now))
        place = save_report(folder, entries)
        show(figures_of(entries), verdict_table(entries), as_json)
    say_written(folder, place, f"Read {place / 'report.md'}", as_json)
    if ctrl_c.noted:
        note(f"interrupted; what was obtained until then is in {final_path(folder, place)}")
        sys.exit(INTERRUPTED)


@click.command(short_help="Fit an observer's parameters to the gyro.")
@click.option("--observer", metavar="NAME", help="What to tune: a name, or your own as package.module:Class.")
@partial(run_options, required=False)
@click.option(
    "--worlds",
    type=click.IntRange(2, MOST_WORLDS // 10),  # whose trajectories are kept
    default=20,
    show_default=True,
    metavar="N",
    help="Worlds that are fitted; as many more are held out to score on.",
)
@click.option("--parameters", default="", metavar="NAMES", help="What to tune, with commas between; all by default.")
@click.option(
    "--range",
    "ranges",
    multiple=True,
    metavar="NAME=LOW:HIGH",
    help="Where to search for a parameter; may be given again.",
)
@click.option(
    "--noise",
    default="",
    metavar="LIST",
    help="Accelerometer noise densities to tune at [ug/rtHz]; of a log NAME=VALUE,... as replay takes it.",
)
@click.option("--log", "logs", multiple=True, metavar="LOG", help="Tune on your own log instead; may be given again.")
@click.option(
    "--split",
    type=float,
    default=0.5,
    show_default=True,
    metavar="SHARE",
    help="Share of each log, from its start, that is fitted; the rest is scored.",
)
@click.option("--model", metavar="RIG", help="Of a log, your pendulum, as replay takes it.")
@click.option("--skip", type=float, default=1.0, metavar="SECONDS", help="Of a log, not judged after each start.")
@of_a_log
@users_code()
def tune(
    arguments: RunArguments,
    observer: str | None,
    worlds: int,
    parameters: str,
    ranges: tuple[str, ...],
    noise: str,
    logs: tuple[str, ...],
    split: float,
    model: str | None,
    skip: float,
    reading: LogArguments,
) -> None:
    """Fit an observer's parameters to the gyro, as section V of aranovskiy2020 does; observer_tuning is its experiment.

    The loop is closed on the gyro, whatever the scenario says, and the recording replayed through the observer. Scored
    is the estimated rate less the gyro's, from each push to one second after it, on worlds that were not fitted, beside
    the observer's parameters as given (by default, the paper's). With several noise densities it says at which the
    given parameters are the best ones.

    Writes a folder: tuned.json, and scenario.toml, which runs with the tuned observer.

    With --log and --columns (as in replay) instead of SCENARIO it is a log's reference that is fitted, on one part of
    the log, and scored on another: cmg-mj tune --log LOG.csv --columns tilt=pitch_deg,rate=gyro_dps --observer linear
    """
    chosen_numbers = [name.strip() for name in parameters.split(",") if name.strip()]
    if logs:
        refuse_given(("worlds", "seed"), "is for a scenario; a log is what it is")
        found = dict(map(_range, ranges))
        _tune_on_logs(arguments, observer, logs, reading, split, model, noise, skip, chosen_numbers, found)
        return
    if not arguments.name:
        raise InputError("tune: name a scenario, such as observer_tuning, or a log with --log")
    refuse_given((*READING, "split", "model", "skip"), "is for --log LOG")
    from cmg_mj.studies.save import file_name
    from cmg_mj.studies.tuning import figures_of, files_of_study, save_study, tuning_table
    from cmg_mj.studies.tuning import tune as fit

    if observer is not None:
        check_observer("--observer", observer)
    scenario = arguments.scenario(observer)
    default = Path("runs") / f"tune-{file_name(scenario.observer.kind)}-{scenario.seed}"
    densities = [_density(text) for text in noise.split(",") if text.strip()]
    if noise and not densities:
        raise InputError(f"--noise {noise!r}: give numbers with commas between")
    folder = claim_folder(default if arguments.out is None else output_path(arguments.out), files_of_study(densities))
    with CtrlC() as ctrl_c:
        with progress(f"{scenario.title or arguments.name}: {scenario.observer.kind}", 1.0, ctrl_c) as on_progress:
            study = fit(
                scenario,
                worlds=worlds,
                parameters=chosen_numbers,
                ranges=dict(_range(text) for text in ranges),
                noise_ug_rthz=densities,
                on_share=on_progress,
            )
        show(figures_of(study), tuning_table(study), arguments.as_json)
        wanted = len(densities) or 1
        files = save_study(folder, study, complete=len(study.levels) == wanted)
    place = files[0].parent
    say_written(folder, place, f"Run with the tuned observer: cmg-mj run {files[1]}", arguments.as_json)
    if ctrl_c.noted:
        note(f"interrupted; {len(study.levels)} of {wanted} noise densities are in {final_path(folder, place)}")
        sys.exit(INTERRUPTED)


def _tune_on_logs(
    arguments: RunArguments,
    observer: str | None,
    logs: Sequence[str],
    reading: LogArguments,
    split: float,
    model: str | None,
    noise: str,
    skip: float,
    parameters: Sequence[str],
    ranges: Mapping[str, tuple[float, float]],
) -> None:
    """Tune on a user's logs."""
    from cmg_mj.replay.parameter_options import parameters_of
    from cmg_mj.replay.user_noise import noise_numbers
    from cmg_mj.replay.user_pendulum import model_of
    from cmg_mj.studies.save import file_name
    from cmg_mj.studies.tuning import figures_of_logs, logs_table, save_log_study, tune_on_logs
    from cmg_mj.studies.tuning.save import plain
    from cmg_mj.studies.tuning.save_on_logs import FILES

    if arguments.name:
        raise InputError(f"{arguments.name}: either a scenario or --log, not both")
    if observer is None:
        raise InputError("--log: say which observer, --observer NAME")
    check_observer("--observer", observer)
    for setting in arguments.settings:
        if not setting.startswith("observer."):
            raise InputError(f"--set {setting}: of a log write observer.PARAMETER=VALUE")
    given = parameters_of([observer + setting.removeprefix("observer") for setting in arguments.settings])
    if noise and "=" not in noise:
        raise InputError(f"--noise {noise}: densities are for a scenario; of a log write NAME=VALUE,... as in replay")
    noises = noise_numbers(noise)
    each_once(logs)
    read = [reading.read(path) for path in logs]
    pendulum = None if model is None else model_of(model)
    default = Path("runs") / f"tune-{file_name(observer)}-{safe_name(read[0].name)}"
    folder = claim_folder(default if arguments.out is None else output_path(arguments.out), FILES)
    with CtrlC() as ctrl_c:
        with progress(f"{read[0].name}: {observer}", 1.0, ctrl_c) as on_progress:
            study = tune_on_logs(
                read,
                observer,
                model=pendulum,
                noises=noises,
                given=given.get(observer),
                split=split,
                skip_s=skip,
                parameters=parameters,
                ranges=ranges,
                on_share=on_progress,
            )
        show(figures_of_logs(study), logs_table(study), arguments.as_json)
        place = save_log_study(folder, study)
    found = plain({n.parameter: study.level.parameters[n.parameter] for n in study.numbers})
    settings = " ".join(f"--set '{observer}.{name}={json.dumps(value)}'" for name, value in found.items())
    say_written(folder, place, f"Replay it tuned: {settings}", arguments.as_json)


def _range(text: str) -> tuple[str, tuple[float, float]]:
    """`L=10.4:1000` -> its name and its ends."""
    name, _, ends = text.partition("=")
    low, _, high = ends.partition(":")
    try:
        return name.strip(), (float(low), float(high))
    except ValueError as error:
        raise InputError(f"--range {text!r}: write NAME=LOW:HIGH, for example tau=0.005:0.1") from error


def _density(text: str) -> float:
    try:
        density = float(text)
    except ValueError:
        density = -1.0
    if not 0.0 <= density < math.inf:
        raise InputError(f"--noise {text.strip()!r}: must be numbers not below 0, with commas between")
    return density
