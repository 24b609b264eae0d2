"""Many worlds of the scenario push_recovery on several rigs, and what one observer gains on another there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmg_mj.results.intervals import Interval, known_interval
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

ERROR = "velocity_rms_error_rad_s"
"""The measure that is compared."""


def push_recovery(kind: str, seed: int, settings: Sequence[str] = ()) -> Experiment:
    """Prepare the scenario with an observer, and with other settings."""
    return prepare(load_scenario("push_recovery", [f"seed={seed}", "open_loop_observers=[]", *settings], kind))


def on_rigs(experiment: Experiment, worlds: int, field: str, values: Sequence[float]) -> list[Result]:
    """Run the same worlds on rigs that differ in one setting, all in one batch.

    Args:
        experiment: The experiment; its own value of the setting does not count.
        worlds: Worlds a rig; world i has the same noise on all.
        field: The setting, a field of [plant].
        values: Its value on each rig.

    Returns:
        A result a rig.
    """
    values_by_world = [value for value in values for _ in range(worlds)]
    numbers = [*range(worlds)] * len(values)
    return experiment.run_many(numbers, settings={field: values_by_world}, keep_trajectory=False).split(len(values))


def gain(errors_before: np.ndarray, errors_after: np.ndarray) -> Interval | None:
    """Return how much an error shrank, world by world, in those that stood both times; None if fewer than two did."""
    return known_interval(errors_before - errors_after)
