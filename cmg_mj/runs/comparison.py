"""Several observers on the same plant, pushes and noise."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from cmg_mj.core.types import BIAS, extra_signals
from cmg_mj.plant.plant import Plant, load_scenario_plant
from cmg_mj.results.intervals import finite_values
from cmg_mj.results.result import Outcome, Result
from cmg_mj.results.summary_keys import NESTED, Summary, finite
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.schema import CompareSettings, Scenario


@dataclasses.dataclass(frozen=True)
class ComparedObserver:
    """One observer's part in a comparison.

    Attributes:
        experiment: The scenario with this observer in the loop.
        result: All worlds, without trajectories.
        world_0: World 0 once more, with its trajectory.
    """

    experiment: Experiment
    result: Result
    world_0: Result

    @property
    def kind(self) -> str:
        """The observer."""
        return self.experiment.scenario.observer.kind

    @property
    def stopped(self) -> list[Outcome]:
        """The worlds that could not go on, because the observer failed or the plant diverged."""
        return [outcome for outcome in self.result.outcomes if outcome.kind == "stopped"]

    @property
    def summary(self) -> Summary:
        """Means over the worlds that stood to the end, by the names of a run's summary, and the share of falls."""
        result, scenario = self.result, self.experiment.scenario
        worlds = len(result.outcomes)
        return finite(
            {
                "observer": scenario.observer.kind,
                "seed": scenario.seed,
                "differs": self.experiment.differences,
                "worlds": worlds,
                "fell": bool(result.fell.any()),
                "fell_fraction": float(result.fell.mean()),
                "stopped_fraction": len(self.stopped) / worlds,
                "settled_fraction": sum(summary["settle_time_s"] is not None for summary in result.summaries) / worlds,
                **{key: result.mean(key) for key in result.summaries[0] if key not in NESTED},
                "velocity_rms_error_std_rad_s": standard_deviation(result.values("velocity_rms_error_rad_s")),
            }
        )


def standard_deviation(values: np.ndarray) -> float | None:
    """Compute the standard deviation over the worlds that have a figure, (n_worlds,); None of fewer than two."""
    known = finite_values(values)
    return float(known.std(ddof=1)) if len(known) > 1 else None


def prepare_comparison(scenario: Scenario, observers: Sequence[str]) -> list[Experiment]:
    """Make every observer's experiment ready, on the same plant, pushes and noise.

    Args:
        scenario: The experiment.
        observers: Their names.

    Returns:
        One experiment an observer; `controller.bias_trim_s` counts for those that estimate the bias.

    Raises:
        InputError: An observer does not exist, or something does not fit.
    """
    plant = load_scenario_plant(scenario)
    return [prepare(_untrimmed(scenario.with_observer(kind), plant), plant) for kind in observers]


def _untrimmed(scenario: Scenario, plant: Plant) -> Scenario:
    """Turn the integrator's trim off where the observer does not estimate the bias that it takes."""
    controller, sensors = scenario.controller, scenario.sensors
    arguments = 1.0 / controller.rate_hz, plant.reduced, plant.parameters.noise(sensors)
    if not controller.bias_trim_s or BIAS in extra_signals(scenario.observer.make(*arguments)):
        return scenario
    return scenario.model_copy(update={"controller": controller.model_copy(update={"bias_trim_s": 0.0})})


def compare(
    experiments: Sequence[Experiment], worlds: int, on_progress: Callable[[float], None] | None = None
) -> list[ComparedObserver]:
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
        world_0 = experiment.run(on_progress=lambda time, report=report, end=duration: report(end))
        if world_0.outcomes[0].kind == "interrupted":
            break
        compared.append(ComparedObserver(experiment, result, world_0))
    return compared


def rerunnable(scenario: Scenario, experiments: Sequence[Experiment], worlds: int) -> Experiment:
    """Choose the experiment whose scenario, written out, runs to the same comparison again.

    Args:
        scenario: The scenario that was to be compared.
        experiments: The experiments of `prepare_comparison`.
        worlds: How many worlds.

    Returns:
        The experiment of the scenario's own observer, whose parameters count, if it is there. Otherwise one that keeps
        `controller.bias_trim_s`. With the observers and the number of worlds in [compare].
    """
    same = [e for e in experiments if e.scenario.observer.kind == scenario.observer.kind]
    trimmed = [e for e in experiments if e.scenario.controller.bias_trim_s]
    choice = (same or trimmed or list(experiments))[0]
    settings = CompareSettings(observers=[e.scenario.observer.kind for e in experiments], worlds=worlds)
    controller = (trimmed or [choice])[0].scenario.controller
    return dataclasses.replace(
        choice, scenario=choice.scenario.model_copy(update={"compare": settings, "controller": controller})
    )
