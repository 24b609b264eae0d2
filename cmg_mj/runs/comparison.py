"""Several observers on the same plant, pushes and noise: their runs, means, intervals, and differences to the best."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.core.types import BIAS, extra_signals
from cmg_mj.plant.plant import Plant, load_scenario_plant
from cmg_mj.results.baselines import BASELINES
from cmg_mj.results.intervals import finite_mean, finite_values, known_ends
from cmg_mj.results.result import Outcome, Result
from cmg_mj.results.summary_keys import KEYS, NESTED, Summary, as_table, finite, section
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.schema import CompareSettings, Scenario
from cmg_mj.scenario.time_grid import time_grid

if TYPE_CHECKING:
    import pyarrow as pa


@dataclass(frozen=True)
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
        worlds, falls = len(result.outcomes), [outcome.time_s for outcome in result.outcomes if outcome.fell]
        return finite(
            {
                "observer": scenario.observer.kind,
                "seed": scenario.seed,
                "differs": self.experiment.differences,
                "worlds": worlds,
                "fell": bool(result.fell.any()),
                "fell_fraction": float(result.fell.mean()),
                "fell_from_to_s": [min(falls), max(falls)] if falls else None,
                "stopped_fraction": len(self.stopped) / worlds,
                "settled_fraction": sum(summary["settle_time_s"] is not None for summary in result.summaries) / worlds,
                **{key: result.mean(key) for key in result.summaries[0] if key not in NESTED},
            }
        )


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
    with scenario.named_in_errors():
        plant = load_scenario_plant(scenario, time_grid(scenario))
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

    def report(done: int, duration: float, time: float) -> None:
        if on_progress:
            on_progress((done + time / duration) / len(experiments))

    for i, experiment in enumerate(experiments):
        result = experiment.run_many(
            worlds, keep_trajectory=False, on_progress=partial(report, i, experiment.scenario.duration_s)
        )
        done = partial(report, i + 1, math.inf)
        for world, outcome in enumerate(result.outcomes):
            if outcome.with_others:  # perhaps by another world's fault
                alone = experiment.run(world=world, keep_trajectory=False, on_progress=done)
                result.outcomes[world], result.summaries[world] = alone.outcomes[0], alone.summaries[0]
        if result.interrupted:
            break
        world_0 = experiment.run(on_progress=done)
        if world_0.interrupted:
            break
        compared.append(ComparedObserver(experiment, result, world_0))
    return compared


def repeatable(scenario: Scenario, experiments: Sequence[Experiment], worlds: int) -> Experiment:
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
    choice = (same or trimmed or experiments)[0]
    settings = CompareSettings(observers=[e.scenario.observer.kind for e in experiments], worlds=worlds)
    changes = {"compare": settings, "controller": (trimmed or [choice])[0].scenario.controller}
    return replace(choice, scenario=choice.scenario.model_copy(update=changes))


PUSH_ERROR, ERROR = "velocity_rms_error_push_rad_s", "velocity_rms_error_rad_s"


@dataclass(frozen=True)
class ComparisonRow:
    """One row of a comparison.

    Attributes:
        entry: An observer in the loop.
        reference: The baseline on that motion, if the row is not the observer's own.
    """

    entry: ComparedObserver
    reference: str | None = None

    @property
    def name(self) -> str:
        """The row's label."""
        return self.reference or self.entry.kind

    def figures(self, key: str) -> np.ndarray:
        """Return a figure of every world, until its end, (n_worlds,); NaN where there is none."""
        return self.entry.result.until_end(key, self.reference)

    def values(self, key: str) -> np.ndarray:
        """Return a figure of every world, (n_worlds,); NaN where a world did not stand or has no such figure."""
        return np.where(self.entry.result.stood, self.figures(key), np.nan)

    @property
    def summary(self) -> Summary:
        """Return the means, as `ComparedObserver.summary` does.

        None for what a baseline does not have, since it closes no loop.
        """
        loop = self.entry.summary
        if self.reference is None:
            return loop
        return {
            **dict.fromkeys(loop),
            "observer": self.reference,
            "in_loop_of": self.entry.kind,
            **{key: loop[key] for key in ("seed", "differs", "worlds")},
            **{key: finite_mean(self.values(key)) for key in loop if key in KEYS},
        }


def best_observer(compared: Sequence[ComparedObserver], key: str) -> ComparedObserver | None:
    """Find the observer with the best mean of a figure, among those that stood in the most worlds."""
    most = max(entry.result.stood.sum() for entry in compared)
    candidates = [entry for entry in compared if entry.result.stood.sum() == most]
    means = [(finite_mean(ComparisonRow(entry).values(key)), entry) for entry in candidates]
    known = [(mean, entry) for mean, entry in means if mean is not None]
    pick = max if KEYS[key].better == "more" else min
    return pick(known, key=lambda pair: pair[0])[1] if known else None


def comparison_rows(compared: Sequence[ComparedObserver]) -> list[ComparisonRow]:
    """List the rows of a comparison: every observer, then the baselines on the motion of the best of them.

    The best observer is the one with the least error in the push window, or over the whole run if there is no push.
    """
    leader = best_observer(compared, PUSH_ERROR) or best_observer(compared, ERROR)
    known = section(leader.result.summaries[0], "references") if leader else {}
    names = [name for name in BASELINES if name in known and name not in {entry.kind for entry in compared}]
    references = [ComparisonRow(leader, name) for name in names] if leader else []
    return [*map(ComparisonRow, compared), *references]


def standings(compared: Sequence[ComparedObserver]) -> list[Summary]:
    """Compute what `cmg-mj compare --json` prints.

    Args:
        compared: The observers with their runs.

    Returns:
        For each row its means; `intervals`: key -> ends of the mean's 95 % interval; `minus_best`: key -> the
        difference to the best observer in this figure, over the worlds in which both have it, with its interval.
    """
    keys = dict.fromkeys(key for entry in compared for key in entry.result.summaries[0] if key in KEYS)
    best = {key: best_observer(compared, key) for key in keys if KEYS[key].better}
    leaders = {key: ComparisonRow(observer) for key, observer in best.items() if observer}
    standing = []
    for row in comparison_rows(compared):
        intervals = {key: known_ends(row.values(key), KEYS[key].positive) for key in keys}
        minus_best = {}
        for key, leader in leaders.items():
            if row != leader:
                less = row.values(key) - leader.values(key)  # world by world
                mean, worlds = finite_mean(less), len(finite_values(less))
                minus_best[key] = {"best": leader.name, "worlds": worlds, "mean": mean, "interval": known_ends(less)}
        standing.append(finite(row.summary | {"intervals": intervals, "minus_best": minus_best}))
    return standing


def worlds_table(compared: Sequence[ComparedObserver]) -> pa.Table:
    """Make a table of every world of every row of a comparison, as `Result.table` does."""
    return as_table(world for row in comparison_rows(compared) for world in row.entry.result.rows(row.reference))
