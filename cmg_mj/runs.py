"""Running a scenario, comparing observers on it, and writing what comes out."""

from __future__ import annotations

import dataclasses
import json
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from cmg_mj.errors import InputError
from cmg_mj.scenario import Experiment, Scenario, prepare
from cmg_mj.simulate import Outcome, Result
from cmg_mj.trajectory import Trajectory, whole_file


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
    def summary(self) -> dict[str, Any]:
        """Means over the worlds that stood to the end, by the names of a run's summary, and the share of falls."""
        outcomes, summaries = self.result.outcomes, self.result.summaries
        stood = [summary for summary, outcome in zip(summaries, outcomes, strict=True) if outcome.kind == "done"]
        means = {key: _mean([summary[key] for summary in stood]) for key in summaries[0] if key not in ("companions",)}
        scenario = self.experiment.scenario
        return {
            "observer": scenario.observer.kind,
            "seed": scenario.seed,
            "worlds": len(outcomes),
            "fell": any(outcome.fell for outcome in outcomes),
            "fell_fraction": sum(outcome.kind != "done" for outcome in outcomes) / len(outcomes),
            "settled_fraction": sum(summary["settle_time_s"] is not None for summary in summaries) / len(outcomes),
            **means,
            "velocity_rms_error_std_rad_s": _deviation([summary["velocity_rms_error_rad_s"] for summary in stood]),
        }


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
    return summary | result.summaries[world]


def compare(
    scenario: Scenario, observers: Sequence[str], worlds: int, on_progress: Callable[[float], None] | None = None
) -> list[Compared]:
    """Run every observer on the same plant, pushes and noise.

    Args:
        scenario: The experiment.
        observers: Their names.
        worlds: How many worlds: world i has the same noise for every observer.
        on_progress: Called now and then with the share done.

    Returns:
        One entry an observer.

    Raises:
        InputError: An observer does not exist or something does not fit; before anything is run.
    """
    experiments = [prepare(scenario.with_observer(kind)) for kind in observers]
    compared = []
    for i, experiment in enumerate(experiments):

        def report(time: float, done: int = i) -> None:
            if on_progress:
                on_progress((done + time / scenario.duration_s) / len(experiments))

        result = experiment.run_many(worlds, keep_trajectory=False, on_progress=report)
        compared.append(Compared(experiment, result, experiment.run()))
        if any(outcome.kind == "interrupted" for outcome in result.outcomes):
            break
    return compared


def output_folder(path: Path) -> Path:
    """Make the folder a run writes to, and find out now whether it can be written.

    Args:
        path: The folder.

    Returns:
        The same.

    Raises:
        InputError: It cannot be made or written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"--out {path}: cannot be written: {error.strerror}") from error
    return path


def save_run(folder: Path, experiment: Experiment, result: Result) -> None:
    """Write scenario.toml, summary.json, trajectory.parquet and recording.rrd, each whole or not at all.

    Args:
        folder: Where.
        experiment: What was run.
        result: One world's result, with its trajectory.

    Raises:
        InputError: The folder cannot be written any more.
    """
    summary = summary_of(experiment, result)
    try:
        experiment.save(folder / "scenario.toml")
        _write_json(folder / "summary.json", summary)
        trajectory_with_metadata(experiment, result).save(folder / "trajectory.parquet")
        _record(folder / "recording.rrd", [(experiment, result)])
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}") from error


def save_comparison(folder: Path, compared: Sequence[Compared]) -> None:
    """Write summary.json, a trajectory an observer, scenario.toml and one recording of world 0 of all of them."""
    try:
        compared[0].experiment.save(folder / "scenario.toml")
        _write_json(folder / "summary.json", [entry.summary for entry in compared])
        for entry in compared:
            name = file_name(entry.experiment.scenario.observer.kind)
            trajectory = trajectory_with_metadata(entry.experiment, entry.example)
            trajectory.save(folder / f"trajectory-{name}.parquet")
        _record(folder / "recording.rrd", [(entry.experiment, entry.example) for entry in compared])
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}") from error


def file_name(kind: str) -> str:
    """An observer's name as a part of a file name: a dotted path's class."""
    return kind.rpartition(":")[2]


def trajectory_with_metadata(experiment: Experiment, result: Result) -> Trajectory:
    """The trajectory with what is needed to know later where it came from."""
    assert result.trajectory is not None
    outcome = dataclasses.asdict(result.outcomes[0])
    return Trajectory(
        result.trajectory.columns,
        {"observers": experiment.observer_names, "outcome": outcome, "scenario": experiment.resolved()},
    )


def _record(path: Path, runs: Sequence[tuple[Experiment, Result]]) -> None:
    from cmg_mj.recording import Recorded, write_recording  # 0.4 s of import, needed only here

    experiment = runs[0][0]
    scenario = experiment.scenario
    recorded = []
    for e, result in runs:
        assert result.trajectory is not None
        outcome: Outcome = result.outcomes[0]
        recorded.append(Recorded(e.scenario.observer.kind, result.trajectory, summary_of(e, result), outcome))
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
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(value, indent=2) + "\n")


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None


def _deviation(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.stdev(known) if len(known) > 1 else None
