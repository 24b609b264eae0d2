"""The leader at a point of a sweep, and the baselines beside the observers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.sweeps import sweep
from cmg_mj.features.sweeps.cells import cells_of, lead_rows
from cmg_mj.features.sweeps.pictures import pictures_of
from cmg_mj.features.sweeps.report import _leads as leads
from cmg_mj.features.sweeps.study import SweepStudy, parse_axis
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj
from tests.features.sweeps.synthetic_trials import BIAS, NOISE, VELOCITY, make_trials

OBSERVERS = ("linear", "zero", "ltv")
GRID = {BIAS: "0,1", NOISE: "100,200,400"}
SHORT = ["duration_s=0.1", "push=[]"]


def error(point: dict[str, Any], name: str, world: int) -> float | None:
    """At 0 degrees linear is ahead of ltv by a tenth, surely but at 400; at 1 degree it falls, ltv too at 400.

    Zero has 0.15 throughout, and ltv the noise in 1e-3.
    """
    if name == "zero":
        return 0.15
    falls = point[BIAS] == 1 and (name == "linear" or point[NOISE] == 400)
    if falls and world == 0:
        return None
    ltv = 1e-3 * point[NOISE]
    chance = 0.5 * ltv * (-1.0) ** world if point[NOISE] == 400 else 0.0
    return ltv if name == "ltv" else 0.9 * ltv + chance


def test_leaders_are_counted_and_baselines_stand_apart() -> None:
    linear, ltv, zero = lead_rows(make_trials(GRID, OBSERVERS, 4, error), VELOCITY)
    assert (linear.name, ltv.name, zero.name, zero.is_baseline) == ("linear", "ltv", "zero", True)
    assert (linear.leads.held, linear.surely.held, linear.close.held) == (3, 2, 3)
    assert (ltv.leads.held, ltv.surely.held, ltv.close.held) == (2, 2, 5)
    assert (zero.leads.held, zero.leads.of) == (4, 6)  # at 200 and 400, and where nobody stood
    assert zero.surely.held == 3  # the leader's worlds pull apart at 400


@pytest.mark.slow
def test_of_a_design_for_indices_the_independent_points_count() -> None:
    ranges = {BIAS: "0:1", NOISE: "100:400"}
    trials = make_trials(ranges, ("linear", "zero"), 2, lambda *_: 0.1, design="sobol", n=4)
    assert lead_rows(trials, VELOCITY)[0].leads == (8, 8)
    assert "independent points" in leads(trials)[1]


def test_the_best_of_a_cell_is_no_baseline() -> None:
    rows = {(row["point"], row["observer"]): row for row in cells_of(make_trials(GRID, OBSERVERS, 4, error))}
    assert rows[1, "zero"][f"{VELOCITY}_best"] == "linear"
    assert rows[1, "zero"][f"{VELOCITY}_behind_best"] == pytest.approx(0.15 - 0.18)


def test_a_map_shows_where_baselines_are_ahead() -> None:
    velocity = pictures_of(make_trials(GRID, OBSERVERS, 4, error))[0].panels[0].map
    assert velocity is not None
    assert velocity.best.tolist() == [[0, 2], [0, 2], [0, -1]]
    assert (velocity.ahead["zero"] > 0.5).tolist() == [[False, False], [True, True], [True, True]]
    assert velocity.ahead["zero"][0, 0] == pytest.approx(0.09 / (0.09 + 0.15))
    plain = pictures_of(make_trials(GRID, ("linear", "ltv"), 4, error))[0].panels[0].map
    assert plain is not None
    assert not plain.ahead


def test_a_falls_map_has_the_true_rate_for_the_baselines() -> None:
    def falling(point: dict[str, Any], name: str, world: int) -> float | None:
        return None if point[BIAS] == 1 and (name == "zero" or world) else error(point, name, world)

    falls = pictures_of(make_trials(GRID, OBSERVERS, 4, falling))[-1].panels[0].map
    assert falls is not None
    assert falls.boundaries["true"].tolist() == [[0.0, 1.0]] * 3
    assert "zero" not in falls.boundaries
    assert not (falls.best == OBSERVERS.index("zero")).any()


@pytest.mark.slow
def test_a_baselines_trials_are_those_beside_the_true_rate() -> None:
    baselines = ["zero", "mems_as_bought", "mems_fused"]
    table = sweep(load_scenario("push_recovery", SHORT), {BIAS: [0.0, 0.5]}, [*baselines, "linear"], worlds=2).trials
    setup = prepare(load_scenario("push_recovery", [*SHORT, "controller.feedback=truth", f"{BIAS}=0.5"], "kalman"))
    run: Result = setup.run_many(2, keep_trajectory=False)
    for name in baselines:
        rows = [row for row in table.to_pylist() if row["observer"] == name and row[BIAS] == 0.5]
        assert [row[VELOCITY] for row in rows] == run.values(VELOCITY, name).tolist()
    assert np.all(run.values(VELOCITY, "zero") > 0.0)


def test_a_baselines_loop_does_not_depend_on_an_observer() -> None:
    scenario = load_scenario("push_recovery", ["controller.angle_source=estimated", "controller.bias_trim_s=0.5"])
    axes = (parse_axis(BIAS, "0,1", BIAS),)
    controller = SweepStudy(scenario, axes, ("zero", "kalman"), 1).scenario_with("zero").controller
    assert (controller.feedback, controller.angle_source, controller.bias_trim_s) == ("truth", "measured", 0.0)
    by_lqg = SweepStudy(load_scenario("push_recovery", ["controller.kind=lqg"]), axes, ("zero", "kalman"), 1)
    with pytest.raises(InputError, match="zero: a baseline's trials have the true rate in the loop, and controller"):
        by_lqg.scenario_with("zero")


def test_what_a_baseline_cannot_do_is_refused() -> None:
    arguments = ["sweep", "push_recovery", "--vary", "observer.k1=10,20", "--observers", "zero,homogeneous"]
    outcome = cmg_mj(*arguments)
    assert outcome.status == 2
    assert "--vary observer.k1: a baseline has no parameters; leave zero out" in outcome.err
    with pytest.raises(InputError, match="no such observer; did you mean 'zero'"):
        sweep("push_recovery", {BIAS: [0.0, 0.5]}, ["zeroo"])
