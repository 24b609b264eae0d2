"""The files that a run and a comparison write."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from cmg_mj.plant.mjcf import quiet
from cmg_mj.results.folder import RunFolder, claimed, write_parquet, write_text
from cmg_mj.results.result import Outcome, Result
from cmg_mj.results.summary_keys import AXES, OPEN_LOOP_SECTIONS, Summary, finite, section
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.comparison import ComparedObserver, standings, worlds_table
from cmg_mj.runs.experiment import Experiment

if TYPE_CHECKING:
    from cmg_mj.view.recording import RecordingHeader, Run


@dataclass(frozen=True)
class RunReport:
    """One world's run with all that its files and its viewer show, computed once.

    Attributes:
        experiment: The experiment.
        driver: Who called the controller.
        world: Number of the world.
        outcome: The outcome.
        summary: The summary as `--json` prints it.
        trajectory: All ticks, with the outcome, world, driver and scenario as metadata.
        runs: The run for a recording and for plots; of several axes a run each.
    """

    experiment: Experiment
    driver: str
    world: int
    outcome: Outcome
    summary: Summary
    trajectory: Trajectory
    runs: Sequence[Run]


def report_run(experiment: Experiment, result: Result, *, several: bool = False) -> RunReport:
    """Assemble the report of a result's first world.

    Args:
        experiment: The experiment.
        result: Its result, with the trajectory.
        several: Whether a recording has several observers: names of `runs` then begin with the observer.

    Returns:
        The report.
    """
    from cmg_mj.view.recording import Run  # 0.4 s of import, needed only here

    assert result.trajectory is not None
    scenario, outcome = experiment.scenario, result.outcomes[0]
    world = result.world_ids[0] if result.world_ids else 0
    origin: Summary = {"driver": result.driver} if result.driver == "board" else {}
    if world:
        origin["world"] = world
    reason: Summary = {"reason": outcome.reason} if outcome.reason else {}
    summary = finite(
        {
            "scenario": scenario.title,
            "observer": experiment.observer_title,
            "seed": scenario.seed,
            **origin,
            "outcome": outcome.kind,
            "end_time_s": outcome.time_s,
            "fell": outcome.fell,
            "differs": experiment.differences,
            **reason,
            **result.summaries[0],
        }
    )
    ending = {"kind": outcome.kind, "time_s": outcome.time_s, "reason": outcome.reason}
    metadata = {"outcome": ending, **origin, "scenario": experiment.resolved()}
    trajectory = dataclasses.replace(result.trajectory, metadata=metadata)
    observer = scenario.observer.kind
    runs = [Run(observer, trajectory, summary, outcome)]
    if trajectory.axes:
        common = {key: value for key, value in summary.items() if key not in (AXES, *OPEN_LOOP_SECTIONS)}
        runs = [
            Run(f"{observer}, {axis}" if several else axis, trajectory.along(axis), {**common, **part}, outcome, axis)
            for axis, part in section(summary, AXES).items()
        ]
    return RunReport(experiment, result.driver, world, outcome, summary, trajectory, runs)


@quiet()
def save_run(folder: RunFolder | Path, report: RunReport, *, plot: bool = False) -> Path:
    """Write scenario.toml, summary.json, trajectory.parquet and recording.rrd, all at once.

    Args:
        folder: Where to. What cmg_mj has not written there stays, and the next number is taken.
        report: The run.
        plot: Write plot.png as well.

    Returns:
        The folder, or with a number behind its name (see `RunFolder.write`).

    Raises:
        InputError: The folder, or a file, cannot be written.
    """
    from cmg_mj.view.plots.run_plot import plot_run
    from cmg_mj.view.recording import write_recording

    header = recording_header(report.experiment, report.driver, report.world)
    files: dict[str, Callable[[Path], object]] = {
        "trajectory.parquet": report.trajectory.save,
        "summary.json": lambda path: _write_json(path, report.summary),
        "scenario.toml": lambda path: write_text(path, header.scenario_toml),
        "recording.rrd": lambda path: write_recording(path, header, report.runs),
    }
    for run in report.runs if plot else ():
        name = "plot" if run.axis is None else f"plot-{run.axis}"
        files[f"{name}.png"] = partial(plot_run, header=header, run=run)
    with claimed(folder) as place:
        return place.write(files, complete=report.outcome.kind in ("done", "fell"))


@quiet()
def save_comparison(
    folder: RunFolder | Path,
    experiment: Experiment,
    observers: Sequence[ComparedObserver],
    *,
    plot: bool = False,
    complete: bool = True,
) -> Path:
    """Write summary.json, worlds.parquet, scenario.toml, and of world 0 a trajectory an observer and one recording.

    Args:
        folder: Where to. What cmg_mj has not written there stays, and the next number is taken.
        experiment: The experiment whose scenario runs to the same comparison: `comparison.repeatable`.
        observers: The observers with their runs.
        plot: Write plot.png as well: how every figure is distributed over the worlds.
        complete: Whether these are all observers that were to be compared.

    Returns:
        The folder, or with a number behind its name (see `RunFolder.write`).

    Raises:
        InputError: The folder, or a file, cannot be written.
    """
    from cmg_mj.runs.compare_plot import plot_worlds
    from cmg_mj.view.plots.style import short_names
    from cmg_mj.view.recording import write_recording

    reports = [report_run(entry.experiment, entry.world_0, several=len(observers) > 1) for entry in observers]
    header = recording_header(reports[0].experiment)
    names = short_names([entry.kind for entry in observers]).values()
    files: dict[str, Callable[[Path], object]] = {
        **{
            f"trajectory-{name.replace(':', '.')}.parquet": it.trajectory.save
            for name, it in zip(names, reports, strict=True)
        },
        "summary.json": lambda path: _write_json(path, standings(observers)),
        "worlds.parquet": lambda path: write_parquet(
            path, worlds_table(observers), {"scenario": experiment.resolved()}
        ),
        "scenario.toml": experiment.save,
        "recording.rrd": lambda path: write_recording(path, header, [run for it in reports for run in it.runs]),
    }
    if plot:
        files["plot.png"] = lambda path: plot_worlds(path, observers, experiment.scenario.title)
    with claimed(folder) as place:
        return place.write(files, complete=complete)


def file_name(kind: str) -> str:
    """Make an observer's name into a part of a file name: a dotted path's class."""
    return kind.rpartition(":")[2]


def recording_header(experiment: Experiment, driver: str = "native", world: int = 0) -> RecordingHeader:
    """Collect what a recording shows of an experiment; the title says if it ran on the board."""
    from cmg_mj.view.recording import RecordingHeader

    scenario, title = experiment.scenario, experiment.scenario.title
    return RecordingHeader(
        plant=experiment.plant,
        title=(title or "Run") + ", on the board" if driver == "board" else title,
        pushes=scenario.push,
        swings=scenario.swing,
        settings=scenario.metrics,
        rate_limit_rad_s=experiment.law.rate_limit,
        scenario_toml=experiment.as_toml(driver, world),
        lines=[line for stage in experiment.stages() if (line := stage.series(experiment.plant)) is not None],
    )


def _write_json(path: Path, value: Summary | list[Summary]) -> None:
    write_text(path, json.dumps(value, indent=2))
