"""Running a scenario, comparing observers on it, and writing what comes out."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from cmg_mj.engine import quiet
from cmg_mj.experiment import Experiment, load_rig, prepare
from cmg_mj.observers.protocol import BIAS, extra_signals
from cmg_mj.plant import Plant
from cmg_mj.plots import plot_run
from cmg_mj.run_folder import RunFolder, claimed, write_text
from cmg_mj.schema import Scenario
from cmg_mj.simulate import Outcome, Result
from cmg_mj.trajectory import Trajectory


@dataclasses.dataclass(frozen=True)
class Compared:
    """One observer's part in a comparison.

    Attributes:
        experiment: The scenario with this observer in the loop.
        result: All worlds, without trajectories.
        example: World 0 once more, with its trajectory.
    """

    experiment: Experiment
    result: Result
    example: Result

    @property
    def kind(self) -> str:
        """The observer."""
        return self.experiment.scenario.observer.kind

    @property
    def stopped(self) -> list[Outcome]:
        """The worlds that could not go on, because the observer failed or the plant diverged."""
        return [outcome for outcome in self.result.outcomes if outcome.kind == "stopped"]

    @property
    def summary(self) -> dict[str, Any]:
        """Means over the worlds that stood to the end, by the names of a run's summary, and the share of falls."""
        result, scenario = self.result, self.experiment.scenario
        worlds = len(result.outcomes)
        errors = result.values("velocity_rms_error_rad_s")
        errors = errors[np.isfinite(errors)]
        return _finite(
            {
                "observer": scenario.observer.kind,
                "seed": scenario.seed,
                "worlds": worlds,
                "fell": bool(result.fell.any()),
                "fell_fraction": float(result.fell.mean()),
                "stopped_fraction": len(self.stopped) / worlds,
                "settled_fraction": sum(summary["settle_time_s"] is not None for summary in result.summaries) / worlds,
                **{key: result.mean(key) for key in result.summaries[0] if key != "companions"},
                "velocity_rms_error_std_rad_s": float(errors.std(ddof=1)) if len(errors) > 1 else None,
            }
        )


def summary_of(experiment: Experiment, result: Result, world: int = 0) -> dict[str, Any]:
    """One world's summary as `--json` prints it."""
    outcome = result.outcomes[world]
    scenario = experiment.scenario
    summary = {
        "scenario": scenario.title,
        "observer": scenario.observer.kind,
        "seed": scenario.seed,
        "outcome": outcome.kind,
        "end_time_s": outcome.time_s,
        "fell": outcome.fell,
    }
    if outcome.reason:
        summary["reason"] = outcome.reason
    return _finite(summary | result.summaries[world])


def prepare_comparison(scenario: Scenario, observers: Sequence[str]) -> list[Experiment]:
    """Make every observer's experiment ready, on the same plant, pushes and noise.

    Args:
        scenario: The experiment.
        observers: Their names.

    Returns:
        One experiment an observer; `controller.trim_s` counts for those that estimate the bias.

    Raises:
        InputError: An observer does not exist, or something does not fit.
    """
    plant = load_rig(scenario)
    experiments = [prepare(_untrimmed(scenario.with_observer(kind), plant), plant) for kind in observers]
    for experiment in experiments:
        experiment.rehearse(worlds=2)
    return experiments


def _untrimmed(scenario: Scenario, plant: Plant) -> Scenario:
    """The same without trimming the integrator, if the observer does not estimate the bias that takes."""
    controller = scenario.controller
    if not controller.trim_s or BIAS in extra_signals(scenario.observer.make(1.0 / controller.rate_hz, plant.reduced)):
        return scenario
    return scenario.model_copy(update={"controller": controller.model_copy(update={"trim_s": 0.0})})


def compare(
    experiments: Sequence[Experiment], worlds: int, on_progress: Callable[[float], None] | None = None
) -> list[Compared]:
    """Run every experiment in many worlds, and the first world once more with its trajectory.

    Args:
        experiments: One an observer.
        worlds: How many worlds: world i has the same noise for every observer.
        on_progress: Called now and then with the share done.

    Returns:
        One entry an observer; fewer if the user interrupted, and those there are complete.
    """
    compared = []
    for i, experiment in enumerate(experiments):
        duration = experiment.scenario.duration_s

        def report(time: float, done: int = i, duration: float = duration) -> None:
            if on_progress:
                on_progress((done + time / duration) / len(experiments))

        result = experiment.run_many(worlds, keep_trajectory=False, on_progress=report)
        if any(outcome.kind == "interrupted" for outcome in result.outcomes):
            break
        example = experiment.run(on_progress=lambda time, report=report, end=duration: report(end))
        if example.outcomes[0].kind == "interrupted":
            break
        compared.append(Compared(experiment, result, example))
    return compared


def files_of_run(*, plot: bool = False) -> list[str]:
    """Names of what a run writes."""
    return ["trajectory.parquet", "summary.json", "scenario.toml", "recording.rrd", *(["plot.png"] if plot else [])]


@quiet()
def save_run(folder: RunFolder | Path, experiment: Experiment, result: Result, *, plot: bool = False) -> Path:
    """Write scenario.toml, summary.json, trajectory.parquet and recording.rrd, all at once.

    Args:
        folder: Where. What is there and was not written by cmg_mj stays.
        experiment: What was run.
        result: One world's result, with its trajectory.
        plot: Write plot.png as well.

    Returns:
        Where they are: the folder, or one in it (see `RunFolder.write`).

    Raises:
        InputError: The folder, or a file, cannot be written.
    """
    trajectory = trajectory_with_metadata(experiment, result)
    scenario = experiment.scenario
    title = f"{scenario.title or 'Run'}: {scenario.observer.kind}, seed {scenario.seed}"
    writers = (
        trajectory.save,
        lambda path: _write_json(path, summary_of(experiment, result)),
        experiment.save,
        lambda path: _record(path, [(experiment, result)]),
        lambda path: _plot(path, trajectory, title, experiment, result),
    )
    with claimed(folder) as it:
        complete = result.outcomes[0].kind in ("done", "fell")
        return it.write(dict(zip(files_of_run(plot=plot), writers, strict=False)), complete=complete)


def files_of_comparison(kinds: Sequence[str]) -> list[str]:
    """Names of what a comparison of these observers writes."""
    trajectories = [f"trajectory-{name}.parquet" for name in file_names(kinds)]
    return [*trajectories, "summary.json", "scenario.toml", "recording.rrd"]


@quiet()
def save_comparison(folder: RunFolder | Path, compared: Sequence[Compared], *, complete: bool = True) -> Path:
    """Write summary.json, a trajectory an observer, scenario.toml and one recording of world 0 of all of them.

    Args:
        folder: Where. What is there and was not written by cmg_mj stays.
        compared: What was run.
        complete: Whether these are all observers that were to be compared.

    Returns:
        Where they are: the folder, or one in it (see `RunFolder.write`).

    Raises:
        InputError: The folder, or a file, cannot be written.
    """
    writers = (
        *(trajectory_with_metadata(entry.experiment, entry.example).save for entry in compared),
        lambda path: _write_json(path, [entry.summary for entry in compared]),
        with_own_observer([entry.experiment for entry in compared]).save,
        lambda path: _record(path, [(entry.experiment, entry.example) for entry in compared]),
    )
    names = files_of_comparison([entry.kind for entry in compared])
    with claimed(folder) as it:
        return it.write(dict(zip(names, writers, strict=True)), complete=complete)


def with_own_observer(experiments: Sequence[Experiment]) -> Experiment:
    """Of those that are compared, the one with the scenario's own observer and its parameters, if it is there."""
    return next((experiment for experiment in experiments if experiment.scenario.observer.parameters), experiments[0])


def file_names(kinds: Sequence[str]) -> list[str]:
    """Observers' names as parts of file names, no two alike: of a dotted path its class, or all of it."""
    short = [file_name(kind) for kind in kinds]
    return [name if short.count(name) == 1 else kind.replace(":", ".") for name, kind in zip(short, kinds, strict=True)]


def file_name(kind: str) -> str:
    """An observer's name as a part of a file name: a dotted path's class."""
    return kind.rpartition(":")[2]


def trajectory_with_metadata(experiment: Experiment, result: Result) -> Trajectory:
    """The trajectory with what is needed to know later where it came from."""
    assert result.trajectory is not None
    outcome = dataclasses.asdict(result.outcomes[0])
    return dataclasses.replace(result.trajectory, metadata={"outcome": outcome, "scenario": experiment.resolved()})


def _plot(path: Path, trajectory: Trajectory, title: str, experiment: Experiment, result: Result) -> None:
    plot_run(
        path,
        trajectory,
        title,
        summary_of(experiment, result),
        settle_band_deg=experiment.scenario.metrics.settle_band_deg,
        rate_limit_rad_s=experiment.law.rate_limit,
    )


def _record(path: Path, runs: Sequence[tuple[Experiment, Result]]) -> None:
    from cmg_mj.recording import Run, write_recording  # 0.4 s of import, needed only here

    experiment = runs[0][0]
    scenario = experiment.scenario
    recorded = []
    for e, result in runs:
        assert result.trajectory is not None
        outcome: Outcome = result.outcomes[0]
        recorded.append(Run(e.scenario.observer.kind, result.trajectory, summary_of(e, result), outcome))
    write_recording(
        path,
        experiment.plant,
        recorded,
        title=scenario.title,
        pushes=scenario.push,
        settings=scenario.metrics,
        rate_limit_rad_s=experiment.law.rate_limit,
        scenario_toml=tomli_w.dumps(experiment.resolved()),
    )


def _write_json(path: Path, value: Any) -> None:
    write_text(path, json.dumps(value, indent=2))


def _finite(value: Any) -> Any:
    """None for a number that JSON does not know."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
