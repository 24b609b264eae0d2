"""Recordings to tune on."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.tuning import record
from cmg_mj.features.tuning.simulations import tuning_scenario, window_of, windows_of
from cmg_mj.observers import make_observer
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.observers.reference import DT


def test_the_window_is_from_the_push_to_a_second_after_it() -> None:
    assert window_of(load_scenario("observer_tuning")) == pytest.approx((2.0, 3.1))
    assert window_of(load_scenario("observer_tuning", ["duration_s=2.5"])) == pytest.approx((2.0, 2.5))
    assert window_of(load_scenario("observer_tuning", ["push=[]"])) == (0.0, 10.0)


@pytest.mark.slow
def test_what_is_between_two_pushes_is_not_scored() -> None:
    """As in a summary: an estimate of zero would do best there."""
    scenario = load_scenario("observer_tuning", ["seed=5", "push=[{start_s=2},{start_s=4}]", "duration_s=6"], "linear")
    assert [pytest.approx(window) for window in windows_of(scenario)] == [(2.0, 3.1), (4.0, 5.1)]
    recording = record(scenario, range(2))
    run = prepare(scenario).run_many(2, keep_trajectory=False)
    zero = run.values("velocity_rms_error_push_rad_s", "zero")
    assert recording.zero_rms == pytest.approx(zero.mean(), rel=1e-2)  # the gyro's rate, not the true one


@pytest.mark.slow
def test_no_observer_takes_part_in_the_loop_of_the_recording() -> None:
    """Whatever the scenario closes its loop on, the motion recorded is the gyro's loop's."""
    gyro = record(load_scenario("observer_tuning", ["seed=5"]), range(3))
    settings = ["seed=5", "duration_s=10", 'controller.angle_source="estimated"']
    luenberger = record(load_scenario("push_recovery", settings, "luenberger"), range(3))
    for name in ("y1_rad", "y2_rad", "u_rad_s", "fog_rad_s"):
        np.testing.assert_array_equal(gyro.trajectory[name], luenberger.trajectory[name])
    assert tuning_scenario(load_scenario("push_recovery")).controller.feedback == "fog"


@pytest.mark.slow
def test_scores_are_those_of_the_scenario_itself() -> None:
    """The open-loop observers of an ordinary run, summed up by hand, have the errors that the tuning minimises."""
    scenario = load_scenario("observer_tuning", ["seed=5", 'open_loop_observers=["ltv"]', "duration_s=3.2"], "linear")
    run = prepare(scenario).run_many(3).trajectory
    assert run is not None
    window = (run["time_s"] > 1.9999) & (run["time_s"] < 3.0999)
    recording = record(scenario, range(3))
    model = prepare(scenario).plant.reduced
    for name in ("linear", "ltv"):
        off = (run[f"estimate/{name}/x2_rad_s"] - run["fog_rad_s"])[window]
        np.testing.assert_allclose(recording.errors(make_observer(name, DT, model)), np.sqrt((off**2).mean(axis=0)))


def test_worlds_that_fell_are_left_out_and_too_many_are_refused() -> None:
    scenario = load_scenario("observer_tuning", ["plant.equilibrium_bias_deg=20.0"])
    with pytest.raises(InputError, match="3 of 3 worlds fell"):
        record(scenario, range(3))


def test_noise_is_that_of_the_level() -> None:
    quiet, loud = (
        record(load_scenario("observer_tuning", ["duration_s=2.5"]), range(2), noise_ug_rthz=n) for n in (100.0, 800.0)
    )
    spread = [np.diff(r.trajectory["y1_rad"][:300], axis=0).std() for r in (quiet, loud)]
    assert 4.0 < spread[1] / spread[0] < 9.0


def test_the_gyro_is_recorded_for_an_observer_that_needs_it() -> None:
    scenarios = [tuning_scenario(load_scenario("observer_tuning", (), kind)) for kind in ("mems_fused", "ltv")]
    assert [scenario.open_loop_observers for scenario in scenarios] == [["mems_fused"], []]
