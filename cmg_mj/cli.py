"""The commands. What they need is imported when they run, so that --help is quick and Ctrl-C is heard at once."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cmg_mj.errors import InputError, nearest

if TYPE_CHECKING:
    from cmg_mj.scenario import Experiment
    from cmg_mj.schema import Scenario

DONE, WRONG_INPUT, INTERRUPTED = 0, 2, 130

HELP = """A bench for gyroscopic stabilisation: a six-body scissored pair, real sensors, velocity observers.

A scenario is named by a bundled one's name (cmg-mj list scenarios) or by the path of a TOML file.

\b
  cmg-mj run push_recovery
  cmg-mj run push_recovery --observer ltv --set plant.equilibrium_bias_deg=1.0 --seed 3
  cmg-mj compare push_recovery --observers all
  rerun runs/push_recovery-homogeneous-0/recording.rrd

Ctrl-C ends a run early and keeps what was recorded; a second one ends it at once.

Exit status: 0 done (a fall is a result), 2 the input is wrong, 130 interrupted.
"""


def _common(command: Callable) -> Callable:
    """Arguments of every command that runs a scenario."""
    for decorate in reversed(
        (
            click.argument("scenario"),
            click.option(
                "--set",
                "settings",
                multiple=True,
                metavar="FIELD=VALUE",
                help="Replace a field of the scenario, such as plant.initial_tilt_deg=2.0; may be given again.",
            ),
            click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Seed of the sensors' noise."),
            click.option("--out", metavar="FOLDER", help="Folder to write to; by default one in runs/."),
            click.option(
                "--json", "as_json", is_flag=True, help="Print the summary alone, as JSON, on standard output."
            ),
        )
    ):
        command = decorate(command)
    return command


_observers = click.option(
    "--observers",
    default="all",
    show_default=True,
    metavar="NAMES",
    help="Names with commas between, or all; your own as package.module:Class.",
)


class Interruptible(click.Group):
    """Commands that Ctrl-C ends with one line and exit status 130."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            _say("interrupted")
            sys.exit(INTERRUPTED)


@click.group(
    cls=Interruptible, help=HELP, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(package_name="cmg_mj", prog_name="cmg-mj")
def cli() -> None:  # noqa: D103  (its help is HELP)
    pass


@cli.command(short_help="Run a scenario: summary, trajectory, rerun recording.")
@click.option("--observer", metavar="NAME", help="Observer in the loop: a name, or your own as package.module:Class.")
@_common
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
    out: str | None,
    as_json: bool,
    observer: str | None,
    driver: str,
    plot: bool,
) -> None:
    """Run a scenario and write a folder.

    Its files: summary.json, trajectory.parquet, recording.rrd (a rerun recording), and scenario.toml, which has every
    default written out and reruns to the same numbers.
    """
    from cmg_mj import report, runs
    from cmg_mj.scenario import prepare

    if observer is not None:
        _check_observer("--observer", observer)
    chosen = _scenario(scenario, settings, seed, observer)
    experiment = prepare(chosen)
    kind = runs.file_name(chosen.observer.kind)
    folder = _folder(out, f"{Path(scenario).stem}-{kind}-{chosen.seed}", experiment)
    with CtrlC() as ctrl_c:
        with _progress(chosen.title or scenario, chosen.duration_s, ctrl_c) as on_progress:
            result = experiment.run(driver=driver, on_progress=on_progress)  # type: ignore[arg-type]
        summary = runs.summary_of(experiment, result)
        try:
            runs.save_run(folder, experiment, result, plot=plot)
        finally:
            _print(summary, report.summary_table(summary), as_json)
    if not as_json:
        _say_written(folder)
    outcome = result.outcomes[0]
    if outcome.kind == "stopped":
        raise InputError(f"{outcome.reason}; what was recorded until then is in {folder}")
    if outcome.kind == "interrupted":
        _say(f"interrupted at {outcome.time_s:g} s; what was recorded until then is in {folder}")
        sys.exit(INTERRUPTED)
    if ctrl_c.noted:
        _say(f"interrupted when all was done; it is in {folder}")
        sys.exit(INTERRUPTED)


@cli.command(short_help="Run several observers on the same plant, pushes and noise.")
@_observers
@_common
@click.option(
    "--worlds",
    type=click.IntRange(min=1),
    default=20,
    show_default=True,
    metavar="N",
    help="Runs an observer, each with noise of its own; all observers get the same.",
)
@click.option("--markdown", is_flag=True, help="Print the table as Markdown.")
def compare(
    scenario: str,
    settings: tuple[str, ...],
    seed: int | None,
    out: str | None,
    as_json: bool,
    observers: str,
    worlds: int,
    markdown: bool,
) -> None:
    """Run several observers on the same plant, pushes and noise: one table, one recording.

    The table has the means over the worlds that stood to the end; the recording has world 0 of every observer.
    """
    from cmg_mj import report, runs

    names = _names(observers)
    chosen = _scenario(scenario, settings, seed, None)
    for setting in settings:
        if setting.startswith("observer.") and chosen.observer.kind not in names:
            raise InputError(
                f"--set {setting}: is a setting of {chosen.observer.kind}, which is not among "
                f"--observers {observers}; the others are compared with their default parameters"
            )
    experiments = runs.prepare_comparison(chosen, names)
    folder = _folder(out, f"{Path(scenario).stem}-compare-{chosen.seed}", runs.asked_for(experiments))
    with CtrlC() as ctrl_c:
        with _progress(f"{chosen.title or scenario}, {len(names)} observers", 1.0, ctrl_c) as on_progress:
            compared = runs.compare(experiments, worlds, on_progress)
        if not compared:
            _say("interrupted before the first observer was done; nothing was written")
            sys.exit(INTERRUPTED)
        summaries = [entry.summary for entry in compared]
        try:
            runs.save_comparison(folder, compared)
        finally:
            title = f"{chosen.title or scenario}: {worlds} worlds an observer, seed {chosen.seed}"
            table = report.comparison_markdown(summaries) if markdown else report.comparison_table(summaries, title)
            _print(summaries, table, as_json)
    if not as_json:
        _say_written(folder)
    for entry in compared:
        if entry.stopped:
            _say(f"{entry.kind}: {len(entry.stopped)} of {worlds} worlds stopped: {entry.stopped[0].reason}")
    if ctrl_c.noted or len(compared) < len(names):
        _say(f"interrupted; {len(compared)} of {len(names)} observers are in {folder}")
        sys.exit(INTERRUPTED)
    if any(entry.stopped for entry in compared):
        sys.exit(WRONG_INPUT)


@cli.command("list", short_help="List the bundled scenarios and the observers.")
@click.argument("what", type=click.Choice(["scenarios", "observers"]), required=False)
def list_names(what: str | None) -> None:
    """List the bundled scenarios and the observers.

    An observer's parameters are shown with their defaults; change them with --set observer.NAME=VALUE.
    """
    from cmg_mj import report

    if what in (None, "scenarios"):
        click.echo(report.scenario_list())
    if what is None:
        click.echo()
    if what in (None, "observers"):
        click.echo(report.observer_list())


@cli.command(short_help="Check a scenario file without running it.")
@click.argument("file")
def check(file: str) -> None:
    """Check a scenario file without running it, and say what it amounts to."""
    from cmg_mj import report
    from cmg_mj.scenario import load_scenario, prepare

    click.echo(report.description(file, prepare(load_scenario(file))))


@cli.command(short_help="Time the closed loop against bare MuJoCo.")
@_observers
@click.option(
    "--worlds", type=click.IntRange(min=1), default=256, show_default=True, metavar="N", help="Worlds of the batch."
)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def bench(observers: str, worlds: int, as_json: bool) -> None:
    """Time the closed loop against bare MuJoCo: microseconds a physics step, and ratios of the same run."""
    from cmg_mj.bench import bench_table, measure

    names = _names(observers)
    with _progress("Bench", 1.0) as on_progress:
        figures = measure(names, worlds, on_progress)
    _print(figures, bench_table(figures), as_json)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of `cmg-mj`: wrong input ends in one line on standard error and exit status 2."""
    if "" not in sys.path:
        sys.path.append("")  # a user's own observer in the current folder; last, so that it can hide nothing
    try:
        cli.main(args=arguments, prog_name="cmg-mj", standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        sys.exit(WRONG_INPUT)
    except (InputError, click.ClickException) as error:
        _say(error.format_message() if isinstance(error, click.ClickException) else str(error))
        sys.exit(WRONG_INPUT)
    except (KeyboardInterrupt, click.Abort):  # before or after a command
        _say("interrupted")
        sys.exit(INTERRUPTED)
    except OSError as error:
        with suppress(OSError):  # so that Python does not try again to write what it still has
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):  # the reader, such as head, has had enough
            sys.exit(DONE)
        _say(f"{error.filename or 'standard output'}: {error.strerror}")
        sys.exit(WRONG_INPUT)


class CtrlC:
    """Ctrl-C while something is run and written: the first is noted and acted on by `check`, the second acts at once.

    So a run ends between two ticks, and a file that is being written is finished.

    Attributes:
        noted: Whether there was one.
    """

    def __init__(self) -> None:
        self.noted = False
        self._before: Any = None

    def __enter__(self) -> CtrlC:
        # Where Ctrl-C is not Python's own affair (another thread, a job in the background), nothing is changed.
        if (
            threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        ):
            self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def _note(self, *signal: Any) -> None:
        if self.noted:
            raise KeyboardInterrupt
        self.noted = True

    def check(self) -> None:
        """Act on what was noted.

        Raises:
            KeyboardInterrupt: There was a Ctrl-C.
        """
        if self.noted:
            raise KeyboardInterrupt


def _scenario(name: str, settings: Sequence[str], seed: int | None, observer: str | None) -> Scenario:
    from cmg_mj.scenario import load_scenario

    scenario = load_scenario(name, settings, observer)
    return scenario if seed is None else scenario.model_copy(update={"seed": seed})


def _folder(out: str | None, default: str, experiment: Experiment) -> Path:
    from cmg_mj.runs import output_folder, unused_folder

    if out == "":
        raise InputError("--out '': name a folder, . for the current one")
    return output_folder(unused_folder(Path("runs"), default, experiment) if out is None else Path(out))


def _names(observers: str) -> list[str]:
    """Observers with commas between, or all of them; no name twice."""
    from cmg_mj.observers import OBSERVERS

    names = list(OBSERVERS) if observers == "all" else [name.strip() for name in observers.split(",") if name.strip()]
    if not names:
        raise InputError(f"--observers {observers!r}: give names with commas between, or all")
    for name in names:
        _check_observer("--observers", name)
    return list(dict.fromkeys(names))


def _check_observer(option: str, name: str) -> None:
    from cmg_mj.observers import OBSERVERS

    if ":" not in name and name not in OBSERVERS:
        raise InputError(
            f"{option} {name!r}: no such observer; {nearest(name, OBSERVERS)}, or your own as package.module:Class"
        )


def _say(message: str) -> None:
    click.echo(f"cmg-mj: {' '.join(message.split())}", err=True)


def _say_written(folder: Path) -> None:
    click.echo(f"Written to {folder}. Open the recording: rerun {folder / 'recording.rrd'}", err=True)


def _print(value: Any, table: Any, as_json: bool) -> None:
    """A table, or text, as wide as the terminal allows and as it is where there is none; or the value as JSON."""
    from rich.console import Console

    if as_json or isinstance(table, str):
        click.echo(json.dumps(value, indent=2) if as_json else table)
        return
    console = Console(markup=False, highlight=False)  # [rad/s] is a unit
    if console.is_terminal:
        console.print(table)
        return
    console = Console(markup=False, highlight=False, width=1000)
    with console.capture() as captured:
        console.print(table)
    click.echo("\n".join(line.rstrip() for line in captured.get().splitlines()).strip("\n"))


@contextmanager
def _progress(label: str, total: float, ctrl_c: CtrlC | None = None) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error, gone when done; silent when that is not a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(label, total=total)

        def on_progress(done: float) -> None:
            if ctrl_c is not None:
                ctrl_c.check()
            progress.update(task, completed=done)

        yield on_progress
