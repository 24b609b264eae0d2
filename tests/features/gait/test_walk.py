"""The biped walks by its gyros, and falls without."""

from __future__ import annotations

import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj

QUIET = "sensors.accelerometer.noise_density_ug_rthz=100"
HELD = "controller.rate_limit_rad_s=1e-6"


def walked(worlds: int, *settings: str) -> Result:
    return prepare(load_scenario("walk", settings)).run_many(worlds, keep_trajectory=False)


def fallen(result: Result) -> int:
    return sum(outcome.kind == "fell" for outcome in result.outcomes)


def test_it_takes_two_steps_and_stands() -> None:
    result = walked(2, QUIET, "gait.steps=2", "duration_s=5.0")
    assert fallen(result) == 0
    assert (result.mean("tilt_rms_deg") or 9.0) < 0.4


def test_with_its_gimbals_held_it_falls() -> None:
    assert fallen(walked(2, QUIET, HELD, "gait.steps=2", "duration_s=5.0")) == 2


@pytest.mark.slow
def test_it_walks_22_steps_and_none_with_held_gimbals() -> None:
    assert fallen(walked(8, QUIET)) == 0
    assert fallen(walked(8, QUIET, HELD)) == 8


def test_means_need_the_models_sensors() -> None:
    with pytest.raises(InputError, match=r"accelerometer.averaged = true: .*scissored_pair.xml has no sensors"):
        prepare(load_scenario("push_recovery", ["sensors.accelerometer.averaged=true"]))


def test_a_plugin_has_no_legs(elsewhere: None) -> None:
    assert (
        "a plugin does not have it" in cmg_mj("plugin", "gyro_free", "--scenario", "walk", "--out", "there").complaint
    )
