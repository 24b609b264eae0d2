"""The commands."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from cmg_mj import report, runs
from cmg_mj.errors import InputError
from cmg_mj.observers import OBSERVERS, observer_class
from cmg_mj.resources import bundled
from cmg_mj.scenario import Scenario, load_scenario, prepare

DONE, WRONG_INPUT, INTERRUPTED = 0, 2, 130


def _common(command: Callable) -> Callable:
    """Arguments of every command that runs a scenario."""
    for decorate in reversed(
        (
            click.argument("scenario"),
            click.option(
                "--set",
                "settings",
                multiple=True,
                metavar="SECTION.FIELD=VALUE",
                help="Replace a field of the scenario; may be given again.",
            ),
            click.option("--seed", type=click.IntRange(min=0), help="Seed of the sensors' noise."),
            click.option("--out", type=click.Path(path_type=Path), help="Folder to write to."),
            click.option(
                "--json", "as_json", is_flag=True, help="Print the summary alone, as JSON, on standard output."
            ),
        )
    ):
        command = decorate(command)
    return command


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="cmg_mj", prog_name="cmg-mj")
def cli() -> None:
    r"""A bench for gyroscopic stabilisation: a six-body scissored pair, real sensors, velocity observers.

    SCENARIO is a bundled scenario's name (cmg-mj list scenarios) or the path of a TOML file.

    \b
    cmg-mj run push_recovery
    cmg-mj run push_recovery --observer ltv --set plant.equilibrium_bias_deg=1.0 --seed 3
    cmg-mj compare push_recovery --observers all
    rerun runs/push_recovery-homogeneous-0/recording.rrd

    Exit status: 0 done (a fall is a result), 2 the input is wrong, 130 interrupted.
    """


@cli.command()
@_common
@click.option("--observer", metavar="NAME", help="Observer in the loop: a name, or your own as package.module:Class.")
@click.option(
    "--driver",
    type=click.Choice(["native", "callback"]),
    default="native",
    show_default=True,
    help="Who calls the controller: the runner, or MuJoCo through its control callback.",
)
@click.option("--plot", is_flag=True, help="Write plot.png as well.")
def run(
    scenario: str,
    settings: tuple[str, ...],
    seed: int | None,
    out: Path | None,
    as_json: bool,
    observer: str | None,
    driver: str,
    plot: bool,
) -> None:
    """Run a scenario: a summary, a trajectory and a rerun recording."""
    chosen = _scenario(scenario, settings, seed, observer)
    experiment = prepare(chosen)
    kind = runs.file_name(chosen.observer.kind)
    folder = runs.output_folder(out or Path("runs") / f"{Path(scenario).stem}-{kind}-{chosen.seed}")
    with _progress(chosen.title or scenario, chosen.duration_s) as on_progress:
        result = experiment.run(driver=driver, on_progress=on_progress)  # type: ignore[arg-type]
    runs.save_run(folder, experiment, result)
    summary = runs.summary_of(experiment, result)
    if plot:
        title = f"{chosen.title}: {chosen.observer.kind}, seed {chosen.seed}"
        report.plot_run(folder / "plot.png", runs.trajectory_with_metadata(experiment, result), title)
    _print(summary, report.summary_table(summary), as_json)
    outcome = result.outcomes[0]
    if not as_json:
        click.echo(f"Written to {folder}. Open the recording: rerun {folder / 'recording.rrd'}", err=True)
    if outcome.kind == "stopped":
        raise InputError(f"{outcome.reason}; what was recorded until then is in {folder}")
    if outcome.kind == "interrupted":
        click.echo(
            f"cmg-mj: interrupted at {outcome.time_s:g} s; what was recorded until then is in {folder}", err=True
        )
        sys.exit(INTERRUPTED)


@cli.command()
@_common
@click.option(
    "--observers", default="all", show_default=True, metavar="NAMES", help="Names with commas between, or all."
)
@click.option(
    "--worlds",
    type=click.IntRange(min=1),
    default=20,
    show_default=True,
    help="Runs an observer, each with noise of its own; all observers get the same.",
)
@click.option("--markdown", is_flag=True, help="Print the table as Markdown.")
def compare(
    scenario: str,
    settings: tuple[str, ...],
    seed: int | None,
    out: Path | None,
    as_json: bool,
    observers: str,
    worlds: int,
    markdown: bool,
) -> None:
    """Run every observer on the same plant, pushes and noise: one table, one recording."""
    chosen = _scenario(scenario, settings, seed, None)
    names = list(OBSERVERS) if observers == "all" else [name.strip() for name in observers.split(",") if name.strip()]
    if not names:
        raise InputError(f"--observers {observers!r}: give names with commas between, or all")
    folder = runs.output_folder(out or Path("runs") / f"{Path(scenario).stem}-compare-{chosen.seed}")
    with _progress(f"{chosen.title or scenario}, {len(names)} observers", 1.0) as on_progress:
        compared = runs.compare(chosen, list(dict.fromkeys(names)), worlds, on_progress)
    runs.save_comparison(folder, compared)
    summaries = [entry.summary for entry in compared]
    if markdown and not as_json:
        click.echo(report.comparison_markdown(summaries))
    else:
        title = f"{chosen.title or scenario}: {worlds} worlds an observer, seed {chosen.seed}"
        _print(summaries, report.comparison_table(summaries, title), as_json)
    if not as_json:
        click.echo(f"Written to {folder}. Open the recording: rerun {folder / 'recording.rrd'}", err=True)
    if len(compared) < len(names):
        click.echo(f"cmg-mj: interrupted; {len(compared)} of {len(names)} observers are in {folder}", err=True)
        sys.exit(INTERRUPTED)


@cli.command("list")
@click.argument("what", type=click.Choice(["scenarios", "observers"]), required=False)
def list_names(what: str | None) -> None:
    """List the bundled scenarios and the observers."""
    if what in (None, "scenarios"):
        click.echo("Scenarios:")
        for name in bundled("scenarios"):
            click.echo(f"  {name:20} {load_scenario(name).title}")
    if what in (None, "observers"):
        click.echo("Observers:")
        for name in OBSERVERS:
            module = sys.modules[observer_class(name).__module__]
            click.echo(f"  {name:20} {(module.__doc__ or '').splitlines()[0]}")


@cli.command()
@click.argument("file")
def check(file: str) -> None:
    """Check a scenario file without running it."""
    experiment = prepare(load_scenario(file))
    scenario = experiment.scenario
    gains = ", ".join(f"{gain:g}" for gain in experiment.law.gains)
    click.echo(
        f"{file}: valid. {scenario.duration_s:g} s of {experiment.plant.path.name} at {scenario.controller.rate_hz:g} Hz, "
        f"observer {scenario.observer.kind}, K_e = [{gains}], {len(scenario.push)} push(es)"
    )


@cli.command()
@click.option(
    "--observers", default="all", show_default=True, metavar="NAMES", help="Names with commas between, or all."
)
@click.option("--worlds", type=click.IntRange(min=1), default=256, show_default=True, help="Worlds of the batch.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def bench(observers: str, worlds: int, as_json: bool) -> None:
    """Time the closed loop against bare MuJoCo: microseconds a physics step, and ratios of the same run."""
    from cmg_mj.bench import bench_table, measure

    names = list(OBSERVERS) if observers == "all" else [name.strip() for name in observers.split(",")]
    with _progress("Bench", 1.0) as on_progress:
        figures = measure(names, worlds, on_progress)
    _print(figures, bench_table(figures), as_json)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of `cmg-mj`: wrong input ends in one line on standard error and exit status 2."""
    try:
        cli.main(args=arguments, standalone_mode=False)
    except (InputError, click.ClickException) as error:
        message = error.format_message() if isinstance(error, click.ClickException) else str(error)
        click.echo(f"cmg-mj: {' '.join(message.split())}", err=True)
        sys.exit(WRONG_INPUT)
    except (KeyboardInterrupt, click.Abort):
        click.echo("cmg-mj: interrupted; nothing half-written was left behind", err=True)
        sys.exit(INTERRUPTED)


def _scenario(name: str, settings: Sequence[str], seed: int | None, observer: str | None) -> Scenario:
    overrides = list(settings) + ([] if seed is None else [f"seed={seed}"])
    scenario = load_scenario(name, overrides)
    return scenario if observer is None else scenario.with_observer(observer)


def _print(value: Any, table: Any, as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(value, indent=2))
    else:
        console = Console(markup=False)  # [rad/s] is a unit
        console.print(table, width=None if console.is_terminal else 140)


@contextmanager
def _progress(label: str, total: float) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error, gone when done; silent when that is not a terminal."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(label, total=total)
        yield lambda done: progress.update(task, completed=done)
