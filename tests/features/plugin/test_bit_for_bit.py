"""The plugin in MuJoCo's own loop against the runner: every number is the same, bit for bit."""

from __future__ import annotations

import pytest

from cmg_mj.observers import OBSERVERS
from tests.features.plugin.made import (
    ALL_IMPERFECTIONS,
    EFFECTS,
    EXACT,
    SENSORS,
    check_against_runner,
    make,
    needs_compiler,
    variant,
)

pytestmark = [needs_compiler, pytest.mark.slow]

INTEGRATORS = ("RK4", "implicitfast", "Euler")


def check(kind: str, *settings: str, scenario: str = "push_recovery") -> None:
    check_against_runner(make(kind, *settings, scenario=scenario))


@pytest.mark.parametrize("sensors", SENSORS)
@pytest.mark.parametrize("kind", OBSERVERS)
def test_every_observer(kind: str, sensors: str) -> None:
    check(kind, *SENSORS[sensors])


@pytest.mark.parametrize("sensors", SENSORS)
@pytest.mark.parametrize("kind", OBSERVERS)
def test_every_integrator(kind: str, sensors: str) -> None:
    """Over a push, with the library of the test above; docs/studies/plugin_table.py runs 15 s of each."""
    for integrator in ("implicitfast", "Euler"):
        settings = {"plant.integrator": integrator, "duration_s": 4.0, "push.0.start_s": 1.0}
        check_against_runner(variant(make(kind, *SENSORS[sensors]), settings))


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param(("plant.timestep_s=0.001",), id="small steps"),
        pytest.param(("sensors.accelerometer.rate_hz=500", "sensors.encoder.rate_hz=100"), id="other rates"),
        pytest.param(("sensors.accelerometer.latency_s=0.0231", "sensors.encoder.latency_s=0.007"), id="latency"),
        pytest.param(("controller.rate_hz=400", "controller.angle_source=estimated"), id="estimated angles"),
        pytest.param(("controller.gains=scaled", "controller.rate_limit_rad_s=0.6"), id="limited"),
        pytest.param(("controller.lqr.state_cost=[1, 1, 1, 1]", "controller.lqr.input_cost=1.0"), id="lqr"),
        pytest.param(("seed=12345678901",), id="a long seed"),
        pytest.param(("plant.tilt_friction_n_m=0.01", "plant.gimbal_friction_n_m=0.01"), id="friction"),
        pytest.param(("plant.flywheel_speed_rad_s=250", "plant.flywheel_imbalance_kg_m=1e-6"), id="other wheels"),
        pytest.param(("plant.accelerometer_inner_m=0.1", "plant.accelerometer_outer_m=0.2"), id="other places"),
        pytest.param(("plant.tilt_inertia_kg_m2=0.2", "plant.flywheel_momentum_n_m_s=0.9"), id="another pendulum"),
        pytest.param(
            ("plant.accelerometer_inner_across_m=0.15", "plant.accelerometer_outer_angle_deg=90"), id="beside the line"
        ),
        pytest.param(
            ("plant.accelerometer_inner_misplaced_mm=-3", "plant.accelerometer_outer_misplaced_mm=5"), id="misplaced"
        ),
        pytest.param(("sensors.accelerometer.noise_density_ug_rthz=800",), id="noise"),
        *(pytest.param((effect,), id=effect) for effect in EFFECTS),
        pytest.param((*ALL_IMPERFECTIONS, *EFFECTS, *EXACT), id="all effects, unrounded"),
    ],
)
def test_settings(settings: tuple[str, ...]) -> None:
    check("gyro_free", *settings)


def test_means_over_a_sample() -> None:
    biped = ("model=biped", "equilibrium_bias_deg=0.0", "initial_tilt_deg=0.0", "turn_rate_rad_s=0.0")
    settings = ("sensors.accelerometer.averaged=true", "controller.gains=scaled", "duration_s=3.0", "push=[]")
    check("gyro_free", *(f"plant.{setting}" for setting in biped), *settings, scenario="two_axes")


def test_trimmed_integrator() -> None:
    check("adaptive", "controller.bias_trim_s=0.52")


def test_single_gimbal() -> None:
    check("homogeneous", scenario="single_gimbal")


@pytest.mark.parametrize("name", ["Plain", "Elaborate"])
def test_a_users_own_observer(name: str) -> None:
    check(f"tests.features.export.own:{name}")


@pytest.mark.parametrize("sensors", SENSORS)
def test_two_axes_that_turn(sensors: str) -> None:
    check("gyro_free", *SENSORS[sensors], scenario="two_axes")


@pytest.mark.parametrize("settings", [("controller.compensate_turning=false",), ('plant.locked_axes=["roll"]',)])
def test_two_axes_otherwise(settings: tuple[str, ...]) -> None:
    check("homogeneous", *settings, scenario="two_axes")


OWN_LAWS = "tests.features.export.own_laws:"


@pytest.mark.parametrize(
    "kind",
    ["lqg", "examples.own_law:Leaning", *(f"{OWN_LAWS}{name}" for name in ("Elaborate", "InADict", "Memoryless"))],
)
def test_other_laws(kind: str) -> None:
    check("kalman", f"controller.kind={kind}")


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_another_law_with_all_else(integrator: str) -> None:
    """Its integrator is trimmed, its angles are estimated, its rate is the gyro's."""
    words = ("kind=tests.features.export.own_laws:Elaborate", "bias_trim_s=0.52", "angle_source=estimated")
    settings = [f"controller.{word}" for word in (*words, "feedback=fog")]
    check("adaptive", *settings, f"plant.integrator={integrator}", *ALL_IMPERFECTIONS)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("feedback", ["fog", "truth"])
@pytest.mark.parametrize("scenario", ["push_recovery", "two_axes"])
def test_another_rate_fed_back(feedback: str, scenario: str, integrator: str) -> None:
    fog = ("sensors.fog.rate_hz=1000", "sensors.fog.latency_s=0.002", "sensors.fog.bias_deg_h=20")
    check("kalman", f"controller.feedback={feedback}", f"plant.integrator={integrator}", *fog, scenario=scenario)


def test_a_calibrated_gyro_and_two_axes_with_gyros_of_their_own() -> None:
    calibrated = "sensors.mems_gyro.reading=calibrated"
    check("mems_fused", calibrated)
    check("mems_fused", calibrated, "controller.feedback=fog")
    check("mems_fused", scenario="two_axes")
