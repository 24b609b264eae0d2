"""Two axes at once: each held as if it were alone, whatever the other does and however the rig turns."""

import math

import numpy as np
import pytest

from cmg_mj.linear.ceiling import ceiling
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import section
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from tests.recorded import assert_same_bits, recorded
from tests.tiers import slow_but

WORLDS = 20
RATES = (0.0, 1.0, 3.0)
AXES = ("roll", "pitch")
CALM = ("push=[]", "plant.turn_rate_rad_s=0", "plant.equilibrium_bias_deg=0", "axes.pitch.plant.equilibrium_bias_deg=0")


def two_axes(*settings: str) -> Experiment:
    return prepare(load_scenario("two_axes", settings))


def errors(result: Result, axis: str) -> np.ndarray:
    """An axis' velocity RMS error, (n_worlds,)."""
    figures = [section(summary, "axes").get(axis, summary)["velocity_rms_error_rad_s"] for summary in result.summaries]
    return np.array(figures, dtype=float)


@pytest.mark.slow
@pytest.mark.parametrize("rate", RATES)
def test_each_axis_is_estimated_as_with_the_other_locked(rate: float) -> None:
    turn_setting = f"plant.turn_rate_rad_s={rate}"
    result = two_axes(turn_setting).run_many(WORLDS, keep_trajectory=False)
    assert result.stood.all()
    for axis, other in (AXES, AXES[::-1]):
        alone = two_axes(turn_setting, f'plant.locked_axes=["{other}"]').run_many(WORLDS, keep_trajectory=False)
        assert alone.stood.all()
        assert errors(result, axis).mean() == pytest.approx(errors(alone, axis).mean(), rel=0.10)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["two_axes", "two_axes_free_base"])
def test_most_of_the_ceiling_tilt_on_both_axes_at_once_is_recovered_and_more_never(model: str) -> None:
    largest = min(
        math.degrees(ceiling(axis.design.rig.reduced, axis.law.rate_limit).tilt) for axis in two_axes(*CALM).axes
    )
    for share, is_recovered in ((0.8, True), (1.05, False)):
        tilt_setting = f"plant.initial_tilt_deg={share * largest}"
        result = two_axes(*CALM, tilt_setting, f"plant.model={model}", "duration_s=6").run_many(
            10, keep_trajectory=False
        )
        assert result.stood.all() if is_recovered else not result.stood.any()


@pytest.mark.slow
def test_a_turn_is_tolerated_with_gimbals_that_turn_against_it_alone() -> None:
    assert two_axes("plant.turn_rate_rad_s=3").run().outcomes[0].kind == "done"
    uncompensated = two_axes("plant.turn_rate_rad_s=2", "controller.compensate_turning=false")
    assert uncompensated.run().outcomes[0].fell
    assert two_axes("plant.turn_rate_rad_s=0.5", "controller.compensate_turning=false").run().outcomes[0].kind == "done"


def test_turned_the_wrong_way_the_gimbals_make_the_rig_fall_at_one_radian_a_second() -> None:
    experiment = two_axes()
    assert experiment.scenario.plant.turn_rate_rad_s == 1.0
    right = experiment.plant.turning
    experiment.plant.__dict__["turning"] = right._replace(flywheels=np.negative(right.flywheels).tolist())
    assert experiment.run().outcomes[0].fell


@pytest.mark.slow
def test_a_gaits_torque_is_found_by_its_frequency() -> None:
    swings = ",".join(
        f"{{frequency_hz=2.0, amplitude_n_m=1.0, phase_deg={phase}, axis='{axis}'}}"
        for axis, phase in zip(AXES, (0, 90), strict=True)
    )
    gait = ("push=[]", f"swing=[{swings}]", "observer.kind=adaptive")
    baseline = two_axes(*gait).run_many(5, keep_trajectory=False)
    informed = two_axes(*gait, "observer.sinusoid_hz=2").run_many(5, keep_trajectory=False)
    assert baseline.stood.all()
    assert informed.stood.all()
    for axis in AXES:
        assert (errors(informed, axis) < 0.8 * errors(baseline, axis)).all()


@pytest.mark.parametrize("duration_s", slow_but([1.0, 7.0], 1.0))
def test_one_world_of_many_and_the_callback_are_the_same_to_the_bit(duration_s: float) -> None:
    push = [] if duration_s == 7.0 else ["push=[]"]
    experiment = two_axes(f"duration_s={duration_s}", *push, "axes.roll.observer.kind=adaptive")
    many = recorded(experiment.run_many([0, 3]))
    for place, world in enumerate((0, 3)):
        native, callback = (recorded(experiment.run(driver, world)) for driver in ("native", "callback"))
        assert_same_bits(many.world(place), native)
        assert_same_bits(callback, native)


def test_every_axis_has_noise_of_its_own() -> None:
    trajectory = recorded(two_axes(*CALM, "duration_s=4").run())
    noise = [trajectory[f"{axis}/y1_rad"] - trajectory[f"{axis}/x1_rad"] for axis in AXES]
    assert abs(np.corrcoef(np.stack(noise))[0, 1]) < 0.1  # of 800 samples: 0.035 by chance
