"""The files that a run and a comparison write."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from cmg_mj.plant.mujoco_state import quiet
from cmg_mj.results.per_world_table import save_table
from cmg_mj.results.result import Driver, Result
from cmg_mj.results.run_folder import RunFolder, claimed, write_text
from cmg_mj.results.summary_keys import AXES, OPEN_LOOP_SECTIONS, Summary, finite, section
from cmg_mj.results.terminal_tables import run_title
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.studies.compare.comparison import ComparedObserver
from cmg_mj.studies.compare.statistics import standings, worlds_table

if TYPE_CHECKING:
    from cmg_mj.visualization.recording import Run


def summary_of(experiment: Experiment, result: Result, world: int = 0) -> Summary:
    """Assemble one world's summary as `--json` prints it."""
    outcome = result.outcomes[world]
    scenario = experiment.scenario
    summary: Summary = {
        "scenario": scenario.title,
        "observer": experiment.observer_title,
        "seed": scenario.seed,
        **_world_and_driver(result, world),
        "outcome": outcome.kind,
        "end_time_s": outcome.time_s,
        "fell": outcome.fell,
        "differs": experiment.differences,
    }
    if outcome.reason:
        summary["reason"] = outcome.reason
    return finite(summary | result.summaries[world])


def files_of_run(experiment: Experiment, *, plot: bool = False) -> list[str]:
    """List the files that a run writes; for a plant of several axes a plot each."""
    plots = [f"plot-{name}.png" for name in experiment.plant.axis_names] if len(experiment.axes) > 1 else ["plot.png"]
    return ["trajectory.parquet", "summary.json", "scenario.toml", "recording.rrd", *(plots if plot else [])]


@quiet()
def save_run(folder: RunFolder | Path, experiment: Experiment, result: Result, *, plot: bool = False) -> Path:
    """Write scenario.toml, summary.json, trajectory.parquet and recording.rrd, all at once.

    Args:
        folder: Where to. Files there that cmg_mj has not written stay.
        experiment: The experiment.
        result: One world's result, with its trajectory.
        plot: Write plot.png as well.

    Returns:
        The folder, or one in it (see `RunFolder.write`).

    Raises:
        InputError: The folder, or a file, cannot be written.
    """
    trajectory = trajectory_with_metadata(experiment, result)
    summary = summary_of(experiment, result)
    writers = (
        trajectory.save,
        lambda path: _write_json(path, summary),
        lambda path: experiment.save(path, result.driver, _world(result)),
        lambda path: _record(path, [(experiment, result)]),
        *(partial(_plot, run=run, experiment=experiment) for run in to_record(experiment, result)),
    )
    with claimed(folder) as place:
        complete = result.outcomes[0].kind in ("done", "fell")
        return place.write(dict(zip(files_of_run(experiment, plot=plot), writers, strict=False)), complete=complete)


def files_of_comparison(kinds: Sequence[str], *, plot: bool = False) -> list[str]:
    """List the files that a comparison of these observers writes."""
    trajectories = [f"trajectory-{name}.parquet" for name in file_names(kinds)]
    others = ["summary.json", "worlds.parquet", "scenario.toml", "recording.rrd"]
    return [*trajectories, *others, *(["plot.png"] if plot else [])]


@quiet()
def save_comparison(
    folder: RunFolder | Path,
    experiment: Experiment,
    compared: Sequence[ComparedObserver],
    *,
    plot: bool = False,
    complete: bool = True,
) -> Path:
    """Write summary.json, worlds.parquet, scenario.toml, and of world 0 a trajectory an observer and one recording.

    Args:
        folder: Where to. Files there that cmg_mj has not written stay.
        experiment: The experiment whose scenario runs to the same comparison: `comparison.rerunnable`.
        compared: The observers with their runs.
        plot: Write plot.png as well: how every figure is distributed over the worlds.
        complete: Whether these are all observers that were to be compared.

    Returns:
        The folder, or one in it (see `RunFolder.write`).

    Raises:
        InputError: The folder, or a file, cannot be written.
    """
    from cmg_mj.studies.compare.plot import plot_worlds

    writers = (
        *(trajectory_with_metadata(entry.experiment, entry.world_0).save for entry in compared),
        lambda path: _write_json(path, standings(compared)),
        lambda path: save_table(path, worlds_table(compared), {"scenario": experiment.resolved()}),
        experiment.save,
        lambda path: _record(path, [(entry.experiment, entry.world_0) for entry in compared]),
        lambda path: plot_worlds(path, compared, experiment.scenario.title),
    )
    names = files_of_comparison([entry.kind for entry in compared], plot=plot)
    with claimed(folder) as place:
        return place.write(dict(zip(names, writers, strict=False)), complete=complete)


def file_names(kinds: Sequence[str]) -> list[str]:
    """Make observers' names into parts of file names, no two alike: a dotted path's class, or all of the path."""
    short = [file_name(kind) for kind in kinds]
    return [name if short.count(name) == 1 else kind.replace(":", ".") for name, kind in zip(short, kinds, strict=True)]


def file_name(kind: str) -> str:
    """Make an observer's name into a part of a file name: a dotted path's class."""
    return kind.rpartition(":")[2]


def trajectory_with_metadata(experiment: Experiment, result: Result) -> Trajectory:
    """Add to the trajectory how it came about: its outcome, world, driver and scenario."""
    assert result.trajectory is not None
    outcome = {key: getattr(result.outcomes[0], key) for key in ("kind", "time_s", "reason")}
    metadata = {"outcome": outcome, **_world_and_driver(result), "scenario": experiment.resolved()}
    return dataclasses.replace(result.trajectory, metadata=metadata)


def _world(result: Result, at: int = 0) -> int:
    """Return the number of a world, by its place in the result."""
    return result.worlds[at] if result.worlds else at


def _world_and_driver(result: Result, at: int = 0) -> Summary:
    """Name what changes the numbers and stands in no scenario: the driver, if it is the board, and any world but 0."""
    driver: Summary = {"driver": result.driver} if result.driver == "board" else {}
    world = _world(result, at)
    return driver | ({"world": world} if world else {})


def _plot(path: Path, run: Run, experiment: Experiment) -> None:
    from cmg_mj.visualization.plots.run_plot import plot_run

    axis = f", {run.axis}" if run.axis else ""
    plot_run(
        path,
        run.trajectory,
        run_title(run.summary) + axis,
        run.summary,
        settle_band_deg=experiment.scenario.metrics.settle_band_deg,
        rate_limit_rad_s=experiment.law.rate_limit,
    )


def to_record(experiment: Experiment, result: Result, *, compared: bool = False) -> list[Run]:
    """Prepare one world's run for a recording: of several axes a run each, by the axis' name.

    Args:
        experiment: The experiment.
        result: The experiment's result.
        compared: Whether the recording has several observers: the run's name then begins with its observer.

    Returns:
        The runs.
    """
    from cmg_mj.visualization.recording import Run

    assert result.trajectory is not None
    summary, outcome, observer = summary_of(experiment, result), result.outcomes[0], experiment.scenario.observer.kind
    if not result.trajectory.axes:
        return [Run(observer, result.trajectory, summary, outcome)]
    common = {key: value for key, value in summary.items() if key not in (AXES, *OPEN_LOOP_SECTIONS)}
    return [
        Run(
            f"{observer}, {axis}" if compared else axis, result.trajectory.along(axis), {**common, **own}, outcome, axis
        )
        for axis, own in section(summary, AXES).items()
    ]


def recording_title(experiment: Experiment, driver: Driver) -> str:
    """A recording's title: the scenario's, and that it ran on the board if it did."""
    title = experiment.scenario.title
    return (title or "Run") + ", on the board" if driver == "board" else title


def _record(path: Path, runs: Sequence[tuple[Experiment, Result]]) -> None:
    from cmg_mj.visualization.recording import write_recording  # 0.4 s of import, needed only here

    experiment, first = runs[0]
    scenario = experiment.scenario
    write_recording(
        path,
        experiment.plant,
        [run for e, result in runs for run in to_record(e, result, compared=len(runs) > 1)],
        title=recording_title(experiment, first.driver),
        pushes=scenario.push,
        settings=scenario.metrics,
        rate_limit_rad_s=experiment.law.rate_limit,
        scenario_toml=experiment.as_toml(first.driver, _world(first)),
    )


def _write_json(path: Path, value: Summary | list[Summary]) -> None:
    write_text(path, json.dumps(value, indent=2))
