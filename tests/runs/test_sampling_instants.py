"""Every sensor shows the state at its sampling instant, whatever the physics step; delay is latency alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cmg_mj.results.summary_keys import NESTED
from cmg_mj.runs.experiment import Experiment
from tests.recorded import push_recovery, recorded

PERFECT = (
    "duration_s=1",
    "push.0.start_s=0.2",
    "plant.initial_tilt_deg=8",
    "controller.feedback=truth",
    "sensors.accelerometer.noise_density_ug_rthz=0",
    "sensors.accelerometer.counts_per_g=0",
    "sensors.encoder.counts_per_revolution=0",
    "sensors.fog.angle_random_walk_deg_rth=0",
    "sensors.fog.bandwidth_hz=0",
)
STEPS_MS = (0.25, 1.0, 2.5, 5.0)


def perfect(*settings: str) -> Experiment:
    return push_recovery(*PERFECT, *settings)


@pytest.mark.daily_cases("native-0.25", "native-2.5", "callback-1.0", "callback-5.0")
@pytest.mark.parametrize("step_ms", STEPS_MS)
@pytest.mark.parametrize("driver", ["native", "callback"])
def test_perfect_sensors_show_the_present_state_at_every_tick(driver: str, step_ms: float) -> None:
    """At rates of 0.68 rad/s one late step of 5 ms would be off by 3e-3 rad."""
    run = recorded(perfect(f"plant.timestep_s={step_ms / 1e3}").run(driver=driver))
    assert np.abs(run["x2_rad_s"]).max() > 0.6
    e = math.radians(0.5)
    np.testing.assert_allclose(run["y1_rad"], run["x1_rad"] - e, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run["y2_rad"], run["x3_rad"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(run["fog_rad_s"], run["x2_rad_s"], rtol=0.0, atol=1e-12)


@pytest.mark.daily_cases("0.0031-1-0.5", "0.005-1-1.0", "0.0069-2-0.5", "0.0069-2-2.5", "0.005-1-5.0")
@pytest.mark.parametrize("step_ms", [0.5, 1.0, 2.5, 5.0])
@pytest.mark.parametrize(("latency_s", "ticks"), [(0.0031, 1), (0.005, 1), (0.0069, 2)])
def test_latency_is_a_time_and_not_a_number_of_steps(step_ms: float, latency_s: float, ticks: int) -> None:
    """All at 200 Hz: a tick shows the newest sample that has been on its way for so long, whatever the step."""
    late = [f"sensors.{kind}.latency_s={latency_s}" for kind in ("accelerometer", "encoder", "fog")]
    run = recorded(perfect(f"plant.timestep_s={step_ms / 1e3}", *late).run())
    tilt = run["x1_rad"][:-ticks] - math.radians(0.5)
    np.testing.assert_allclose(run["y1_rad"][ticks:], tilt, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run["y2_rad"][ticks:], run["x3_rad"][:-ticks], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(run["fog_rad_s"][ticks:], run["x2_rad_s"][:-ticks], rtol=0.0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["linear", "homogeneous", "adaptive"])
def test_figures_do_not_depend_on_the_step(kind: str) -> None:
    """Means over 64 worlds at 1 ms and at the step that is chosen: 5 ms.

    Two runs of one world part when a rounding error becomes a count, so figures agree as means do. When the tilt
    leaves the settle band for the last time is a threshold: one world that touches it once more moves the mean by a per
    cent, so the median stands for it.
    """
    results = []
    for settings in ([], ["plant.timestep_s=0.001"]):
        experiment = push_recovery("duration_s=6", *settings, observer=kind)
        results.append((experiment.plant.timestep, experiment.run_many(64, keep_trajectory=False)))
    (default_step, coarse), (_, fine) = results
    assert default_step == 0.005
    for key, value in fine.summaries[0].items():
        if key in (*NESTED, "settle_time_s") or value is None:
            continue
        share = key.endswith(("fit", "fit_push", "fraction"))  # of a figure: it may be near zero
        assert coarse.mean(key) == pytest.approx(fine.mean(key), rel=2e-3, abs=2e-3 if share else 1e-12), key
    medians = [float(np.nanmedian(result.values("settle_time_s"))) for result in (coarse, fine)]
    assert medians[0] == pytest.approx(medians[1], abs=0.005)


@pytest.mark.parametrize(
    ("settings", "step_s"),
    [
        pytest.param([], 0.005, id="as bundled"),
        pytest.param(["controller.rate_hz=1000"], 0.001, id="control at 1 kHz"),
        pytest.param(["sensors.fog.rate_hz=300"], 1.0 / 600.0, id="a gyro at 300 Hz"),
        pytest.param(["push.0.start_s=2.001"], 0.001, id="a push off the control's grid"),
        pytest.param(["sensors.encoder.latency_s=0.0001"], 0.005, id="latency needs no step"),
        pytest.param(["sensors.accelerometer.skew_s=0.003"], 0.001, id="the outer's instant"),
        pytest.param(["sensors.accelerometer.bandwidth_hz=94"], 0.001, id="samples inside the part"),
        pytest.param(["plant.flywheel_imbalance_kg_m=1e-6"], 0.0025, id="a wheel that shakes"),
        pytest.param(["plant.integrator=implicit"], 0.001, id="another integrator"),
        pytest.param(["plant.gimbal_damping_n_m_s=1"], 0.00125, id="a stiff damper"),
    ],
)
def test_the_step_that_is_chosen(settings: list[str], step_s: float) -> None:
    """It divides every period and meets every edge, and `check` says the same without loading the rig."""
    experiment = push_recovery(*settings)
    assert experiment.plant.timestep == pytest.approx(step_s, rel=1e-12)
    assert experiment.resolved()["plant"]["timestep_s"] == experiment.plant.timestep
