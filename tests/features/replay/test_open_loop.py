"""Observers replayed on a recording against the same observers in the run itself."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cmg_mj.features.replay import replay
from cmg_mj.observers import OBSERVERS
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from tests.recorded import recorded

SETTINGS = ["duration_s=0.8", "push.0.start_s=0.3", 'open_loop_observers="all"', 'controller.feedback="fog"']


@cache
def experiment() -> Experiment:
    return prepare(load_scenario("push_recovery", [*SETTINGS, "seed=11"]))


@cache
def record(worlds: int | None) -> Trajectory:
    return recorded(experiment().run() if worlds is None else experiment().run_many(worlds))


@pytest.mark.parametrize("worlds", [None, 3])
@pytest.mark.parametrize("name", OBSERVERS)
def test_replay_is_bitwise_what_the_run_recorded(name: str, worlds: int | None) -> None:
    design = experiment().design
    observer = design.open_loop_observers().get(name, design.observer())
    estimate = replay(observer, record(worlds))
    for column, value in zip(("x1_rad", "x2_rad_s", "x3_rad"), estimate, strict=True):
        original = record(worlds)[f"estimate/{name}/{column}"]
        assert value.shape == original.shape
        np.testing.assert_array_equal(value, original)


def test_it_starts_at_the_first_row_it_is_given() -> None:
    part = record(3).between(0.2, 0.6)
    assert part["time_s"][0] == pytest.approx(0.2)
    assert part["time_s"][-1] == pytest.approx(0.6)
    assert len(part) == 81
    x1, x2, x3 = replay(experiment().design.observer(), part)
    np.testing.assert_array_equal(x1[0], part["y1_rad"][0])
    np.testing.assert_array_equal(x2[0], 0.0)
    np.testing.assert_array_equal(x3[0], part["y2_rad"][0])


def test_a_world_that_fell_is_nan_from_there_and_leaves_the_others_alone() -> None:
    columns = {name: values.copy() for name, values in record(3).columns.items()}
    for name in columns:
        if name != "time_s":
            columns[name][50:, 1] = np.nan
    estimator = experiment().design.observer()
    rate, full_rate = replay(estimator, Trajectory(columns)).x2, replay(estimator, record(3)).x2
    assert np.isnan(rate[50:, 1]).all()
    np.testing.assert_array_equal(rate[:50, 1], full_rate[:50, 1])
    np.testing.assert_array_equal(rate[:, [0, 2]], full_rate[:, [0, 2]])
