"""Short runs of bundled scenarios, and trajectories that are the same to the last bit."""

from __future__ import annotations

import numpy as np

from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario


def push_recovery(*settings: str, observer: str | None = None) -> Experiment:
    """The bundled scenario, prepared with settings."""
    return prepare(load_scenario("push_recovery", settings, observer))


def recorded(result: Result) -> Trajectory:
    """The trajectory that a run has kept."""
    assert result.trajectory is not None
    return result.trajectory


def assert_same_bits(ours: Trajectory, theirs: Trajectory) -> None:
    """The same columns, in the same order, with the same numbers."""
    assert list(ours.columns) == list(theirs.columns)
    for name, values in theirs.columns.items():
        np.testing.assert_array_equal(ours[name], values, err_msg=name)
