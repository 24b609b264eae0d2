"""A pole on a light cart that is free: it stands if its tilt is taken about the common mass centre."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from cmg_mj.features.mounting import mount
from cmg_mj.features.mounting import push as simulated_push
from cmg_mj.features.mounting.limits import PUSH_S, WORLDS, push_limits
from cmg_mj.features.mounting.push import TimeLimit
from cmg_mj.features.mounting.write import write_scenario
from cmg_mj.results.summary_keys import section
from cmg_mj.runs.experiment import Experiment
from tests.command import cmg_mj
from tests.features.mounting.push_robots import cart_pole
from tests.features.mounting.test_simulated_push import pushed
from tests.recorded import recorded

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("elsewhere")]


@pytest.fixture(scope="module")
def light_cart(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    """A pole on a cart of 1 kg, which is free."""
    spec = mujoco.MjSpec.from_string(cart_pole())
    model = mount(spec, "pole", axis="hinge", release=["slider"]).save(tmp_path_factory.mktemp("cart") / "rig.xml")
    return write_scenario(model, model, "gyro_free")


def test_a_light_cart_that_is_free_stands(light_cart: Experiment) -> None:
    """Its pivot accelerates as the pole falls, which the tilt about the common mass centre does not show."""
    limits = push_limits(light_cart)
    assert light_cart.scenario.plant.pivot_slides
    assert limits.hints == []
    assert limits.sliding_poles is not None
    assert limits.sliding_poles.about_centre < 0.0 < limits.sliding_poles.about_pivot
    result = simulated_push.simulated_push(light_cart, limits, time_limit=TimeLimit(1000.0))
    assert (result.standing, result.complete) == (WORLDS, True)
    assert 0.6 < result.impulse / limits.push_margin.median_impulse < 1.0
    for seed in (1, 2):
        assert pushed(light_cart.scenario, result.impulse / PUSH_S, seed) == 2 * WORLDS
        assert pushed(light_cart.scenario, 1.8 * result.impulse / PUSH_S, seed) == 0


STAND_ABOUT_THE_CENTRE = ("gyro_free", "free_pivot", "kalman", "homogeneous")


@pytest.mark.parametrize("observer", STAND_ABOUT_THE_CENTRE)
def test_every_observer_stands_on_it_about_the_mass_centre_and_none_about_the_pivot(
    light_cart: Experiment, observer: str
) -> None:
    """The law is fed the measured angle; twenty worlds of another seed."""
    settings = {"seed": 11, "duration_s": 20.0, "plant.initial_tilt_deg": 1.0, "observer.kind": observer}
    stood = [_standing(light_cart, {**settings, "plant.pivot_slides": known}) for known in (True, False)]
    assert stood == [2 * WORLDS, 0]


def test_about_the_pivot_the_true_rate_does_not_help_and_the_estimated_angle_does(light_cart: Experiment) -> None:
    settings = {"seed": 11, "duration_s": 20.0, "plant.initial_tilt_deg": 1.0, "plant.pivot_slides": False}
    assert _standing(light_cart, {**settings, "controller.feedback": "truth"}) == 0
    assert _standing(light_cart, {**settings, "controller.angle_source": "estimated"}) == 2 * WORLDS


@pytest.mark.parametrize(("cart_kg", "stands"), [(1.0, False), (5.0, True)])
def test_the_loops_pole_about_the_pivot_says_who_stands(cart_kg: float, stands: bool) -> None:
    """With the true rate, by the linearisation with servos: 1 kg falls, 5 kg stands."""
    spec = mujoco.MjSpec.from_string(cart_pole(cart_kg))
    model = mount(spec, "pole", axis="hinge", release=["slider"]).save(f"{cart_kg:g}.xml")
    experiment = write_scenario(model, model, "gyro_free")
    poles = push_limits(experiment).sliding_poles
    assert poles is not None
    assert (poles.about_pivot < 0.0) == stands
    settings = {"seed": 11, "duration_s": 20.0, "plant.initial_tilt_deg": 1.0, "plant.pivot_slides": False}
    assert _standing(experiment, {**settings, "controller.feedback": "truth"}) == (2 * WORLDS if stands else 0)


def _standing(experiment: Experiment, settings: dict[str, Any]) -> int:
    return int(experiment.with_settings(settings).run_many(2 * WORLDS, keep_trajectory=False).stood.sum())


def test_a_motion_across_moves_what_the_cart_slides_on_alone(light_cart: Experiment) -> None:
    """Damping of 5e-4 N s/m hands on next to nothing, and the hint says so; vertically the motion is felt."""
    settings: dict[str, Any] = {"duration_s": 3.0, "plant.initial_tilt_deg": 0.5}
    settings |= {"sensors.accelerometer.noise_density_ug_rthz": 0.0, "sensors.accelerometer.counts_per_g": 0.0}
    motion = {"kind": "sine", "acceleration_m_s2": 1.0, "frequency_hz": 2.0}

    def tilts(*pivots: dict[str, Any]) -> np.ndarray:
        return recorded(light_cart.with_settings({**settings, "pivot": list(pivots)}).run())["x1_rad"]

    across, vertical = ({**motion, "direction": direction} for direction in ("across", "vertical"))
    still = tilts()
    assert abs(tilts(across) - still).max() < 0.05 * abs(tilts(vertical) - still).max()
    for pivot, count in ((across, 1), (vertical, 0), ({**across, "acceleration_m_s2": 0.0}, 0)):
        experiment = light_cart.with_settings({"pivot": [pivot]})
        assert sum("pivot.0: accelerates across what the pivot slides on" in hint for hint in experiment.hints) == count


def test_mount_has_the_figures_of_the_pivot() -> None:
    Path("cart.xml").write_text(cart_pole(), encoding="utf-8")
    mounting = ("mount", "cart.xml", "--body", "pole", "--axis", "hinge", "--release", "slider", "--quick")
    figures = json.loads(cmg_mj(*mounting, "--observer", "free_pivot", "--json").out)
    assert figures["pivot_arm_m"] == pytest.approx(0.421, abs=0.001)
    assert figures["pole_tilt_about_centre_1_s"] < 0.0 < figures["pole_tilt_about_pivot_1_s"]
    assert "hint" not in cmg_mj("check", "balanced.toml").out


@pytest.mark.parametrize("known", [True, False])
def test_where_y1_has_the_pivot_in_it_there_is_no_floor_of_the_noise_alone(light_cart: Experiment, known: bool) -> None:
    settings = {"duration_s": 1.0, "plant.initial_tilt_deg": 0.0, "plant.pivot_slides": known}
    (summary,) = light_cart.with_settings({**settings, "controller.angle_source": "estimated"}).run().summaries
    assert ("floor_accel" in section(summary, "references")) == known
