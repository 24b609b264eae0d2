"""The commands that run, compare, list and check scenarios."""

from __future__ import annotations

import sys
from contextlib import suppress
from functools import partial
from pathlib import Path

import click

from cmg_mj.cli.arguments import (
    MAX_NUMBER,
    RunArguments,
    markdown_option,
    observer_option,
    observers_option,
    run_options,
    settings_option,
    worlds_option,
)
from cmg_mj.cli.terminal import (
    WRONG_INPUT,
    CtrlC,
    end_interrupted,
    final_path,
    note,
    note_hints,
    open_recording,
    own_stdout,
    progress,
    say_written,
    show,
    users_code,
)
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.inputs.features import DRIVERS
from cmg_mj.inputs.files import read_toml


@click.command()
@observer_option()
@run_options
@click.option(
    "--driver",
    type=click.Choice(["native", "callback", *DRIVERS]),
    default="native",
    show_default=True,
    help="Run the controller in the simulation loop (native), in MuJoCo's control callback, or as C. The C runs on an "
    "emulated Cortex-M7 (board, see docs/board.md) or inside MuJoCo (plugin, see docs/plugin.md).",
)
@click.option(
    "--world",
    type=click.IntRange(0, MAX_NUMBER),
    default=0,
    metavar="N",
    help="Number of the world: the run has the noise of world N in a comparison or a sweep.  [default: 0]",
)
@click.option("--plot", is_flag=True, help="Also write plot.png; of several axes plot-AXIS.png for each.")
@click.option("--live", is_flag=True, help="Show the run in a rerun viewer as it happens.")
@users_code()
def run(
    arguments: RunArguments,
    observer: str | None,
    driver: str,
    world: int,
    plot: bool,
    live: bool,
) -> None:
    """Run a scenario and write its results to a folder.

    \b
      summary.json        figures of the run
      trajectory.parquet  all signals, a row for each control tick
      recording.rrd       rerun recording
      scenario.toml       scenario with all defaults, which reruns to the same numbers

    A rerun needs the same --driver board and --world, if they were given.
    """  # noqa: D301  (click wants the character itself)
    from cmg_mj.results import reports as tables
    from cmg_mj.runs import save as runs
    from cmg_mj.runs.experiment import prepare
    from cmg_mj.runs.simulate import SimulationOptions

    scenario = arguments.scenario(observer)
    experiment = prepare(scenario)
    note_hints(experiment.hints)
    if scenario.compare:
        note("[compare] is for cmg-mj compare; this is one run")
    folder = arguments.folder(runs.file_name(scenario.observer.kind), experiment, driver, world)
    live_view = None
    if live:
        from cmg_mj.runs.live import LiveView

        live_view = LiveView(runs.recording_header(experiment), scenario.observer.kind)
    with CtrlC() as ctrl_c:
        with progress(scenario.title or arguments.name, scenario.duration_s, ctrl_c) as on_progress:
            options: SimulationOptions = {"on_progress": on_progress}
            if live_view:
                options = live_view.options(on_progress)
            result = experiment.run(driver=driver, world=world, **options)
        if live_view:
            live_view.show()
        report = runs.report_run(experiment, result)
        try:
            place = runs.save_run(folder, report, plot=plot)
        finally:
            show(report.summary, tables.summary_table(report.summary), arguments.as_json)
    say_written(folder, place, open_recording(place), arguments.as_json)
    outcome, where = result.outcomes[0], final_path(folder, place)
    if outcome.kind == "stopped":
        raise RunStopped(f"{outcome.reason}; what was recorded until then is in {where}")
    if outcome.kind == "interrupted":
        end_interrupted(f"interrupted at {outcome.time_s:g} s; what was recorded until then is in {where}")
    if ctrl_c.noted:
        end_interrupted(f"interrupted at the end; the complete run is in {where}")


@click.command()
@observers_option("the scenario's [compare], or all")
@run_options
@worlds_option(
    "Worlds of each observer, each with its own noise, which is the same for all observers.  "
    "[default: the scenario's [compare], or 20]"
)
@markdown_option()
@click.option("--plot", is_flag=True, help="Also write plot.png with the figures of all worlds.")
@users_code()
def compare(
    arguments: RunArguments, observers: list[str] | None, worlds: int | None, markdown: bool, plot: bool
) -> None:
    """Run several observers on the same plant, pushes and noise.

    Prints a table: means over the worlds that stood to the end, with 95 % intervals, and the paired differences to the
    best observer.

    \b
    Writes a folder:
      worlds.parquet  a row for each observer and world
      recording.rrd   rerun recording of every observer's world 0
      scenario.toml   reruns the comparison: cmg-mj compare FOLDER/scenario.toml
    """  # noqa: D301  (click wants the character itself)
    from cmg_mj.core.types import law_needs
    from cmg_mj.results import reports as report
    from cmg_mj.runs import comparison
    from cmg_mj.runs import save as runs
    from cmg_mj.scenario.resolve import describe_differences
    from cmg_mj.scenario.schema import CompareSettings

    scenario = arguments.scenario()
    settings = scenario.compare or CompareSettings()
    names, worlds = observers or settings.names(), worlds or settings.worlds
    for setting in arguments.settings:
        if setting.startswith("observer.") and scenario.observer.kind not in names:
            raise InputError(
                f"--set {setting}: is a setting of {scenario.observer.kind}, which is not among "
                f"--observers {','.join(names)}, of which it sets none: name one by --set observer.kind={names[0]}"
            )
    experiments = comparison.prepare_comparison(scenario, names)
    rerun = comparison.repeatable(scenario, experiments, worlds)
    note_hints(rerun.hints)
    if not law_needs(rerun.law):
        note(f"{scenario.controller.kind} takes nothing of the observer: every loop is the same, the estimates differ")
    folder = arguments.folder("compare", rerun)
    with CtrlC() as ctrl_c:
        with progress(f"{scenario.title or arguments.name}, {len(names)} observers", 1.0, ctrl_c) as on_progress:
            compared = comparison.compare(experiments, worlds, on_progress)
        if not compared:
            end_interrupted("interrupted before the first observer was done; nothing was written")
        summaries = comparison.standings(compared)
        try:
            place = runs.save_comparison(folder, rerun, compared, plot=plot, complete=len(compared) == len(names))
        finally:
            differs = describe_differences(rerun.differences)
            title = f"{scenario.title or arguments.name}: {worlds} worlds an observer, seed {scenario.seed}{differs}"
            table = report.comparison_markdown(summaries) if markdown else report.comparison_table(summaries, title)
            show(summaries, table, arguments.as_json)
    say_written(folder, place, open_recording(place), arguments.as_json)
    for entry in compared:
        if entry.stopped:
            note(f"{entry.kind}: {len(entry.stopped)} of {worlds} worlds stopped: {entry.stopped[0].reason}")
    if ctrl_c.noted or len(compared) < len(names):
        done = f"{len(compared)} of {len(names)} observers"
        end_interrupted(f"interrupted; {done} are in {final_path(folder, place)}")
    if any(entry.stopped for entry in compared):
        sys.exit(WRONG_INPUT)


@click.command("list")
@click.argument("what", type=click.Choice(["scenarios", "observers", "laws"]), required=False)
def list_names(what: str | None) -> None:
    """List the bundled scenarios, the observers and the control laws.

    Parameters are shown with their defaults; change them with --set observer.NAME=VALUE or controller.NAME=VALUE.
    """
    from cmg_mj.laws import LAW_CLASSES
    from cmg_mj.observers import OBSERVER_CLASSES
    from cmg_mj.results import reports as report

    lists = {
        "scenarios": report.scenario_list,
        "observers": lambda: report.class_list(OBSERVER_CLASSES),
        "laws": lambda: report.class_list(LAW_CLASSES),
    }
    click.echo("\n\n".join(lists[name]() for name in ([what] if what else lists)))


@click.command()
@click.argument("file")
@settings_option("Set a field of the scenario, as cmg-mj run does.")
@users_code()
def check(file: str, settings: tuple[str, ...]) -> None:
    """Check a scenario file, or a model file (.xml), without running it, and print its main parameters."""
    from cmg_mj.cli.check import description, rig_description
    from cmg_mj.runs.experiment import prepare
    from cmg_mj.scenario.loading import load_scenario, parse_scenario

    is_model = Path(file).suffix.lower() in (".xml", ".mjb")
    if is_model and settings:
        raise InputError(f"--set {settings[0]}: is for a scenario, as --rig is; {file} is a model")
    scenario = parse_scenario({"plant": {"model": file}}) if is_model else load_scenario(file, settings)
    describe = partial(rig_description, own=_scenario_beside(Path(file))) if is_model else description
    click.echo(describe(file, prepare(scenario).axes), file=own_stdout())


def _scenario_beside(model: Path) -> str:
    """Find the scenario of a model file, as `mount` writes it: beside the model, or beside its plugin's folder."""
    place = model.absolute().parent if model.parent == Path() else model.parent
    stem = place.name.removesuffix("_plugin")
    mounted = place.with_name(f"{stem}.xml") if stem != place.name else model
    for path in (model, mounted):
        with suppress(InputError, AttributeError):  # a scenario that cannot be read is none
            scenario = read_toml(path.with_suffix(".toml"), path.name)
            if scenario.get("plant", {}).get("model") == path.name:
                return str(path.with_suffix(".toml"))
    return ""
