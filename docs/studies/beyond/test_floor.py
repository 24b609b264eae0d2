"""The floor against its continuous closed form, a simulation, and the noise that the rig's tilt really has."""

from __future__ import annotations

import math

import numpy as np
import pytest

from beyond.floor import kalman_filter, velocity_floor
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import prepare
from tests.observers.reference import PAPER

POLE = math.sqrt(PAPER.gravity_torque / PAPER.J1)


def test_floor_has_the_continuous_limit() -> None:
    """Variance 2 l^3 R with R = sigma^2 dt: the mirrored pole, for an unstable rig without process noise."""
    for dt, tolerance in ((1e-3, 0.03), (1e-4, 0.003)):
        expected = math.sqrt(2.0 * POLE**3 * 0.01**2 * dt)
        assert velocity_floor(PAPER, dt, 0.01) == pytest.approx(expected, rel=tolerance)


def test_filter_attains_the_floor_and_a_changed_gain_does_not() -> None:
    Phi, gain, covariance = kalman_filter(PAPER, 0.005, 0.01)
    rng = np.random.default_rng(1)

    def rms(K: np.ndarray) -> float:
        error, squares = np.zeros((2, 2000)), []
        for k in range(1500):
            error = Phi @ error
            error = error - np.outer(K, error[0] - 0.01 * rng.standard_normal(2000))
            if k > 300:
                squares.append(np.mean(error[1] ** 2))
        return math.sqrt(np.mean(squares))

    floor = math.sqrt(covariance[1, 1])
    assert rms(gain) == pytest.approx(floor, rel=0.01)
    for factor in (0.7, 1.4):
        assert rms(gain * factor) > 1.03 * floor


@pytest.mark.parametrize("noise_ug", [100.0, 400.0])
def test_tilt_noise_is_the_rigs(noise_ug: float) -> None:
    """y1 less what it was made from: the true tilt less e."""
    experiment = prepare(
        load_scenario("push_recovery", [f"sensors.accelerometer.noise_density_ug_rthz={noise_ug}", "duration_s=6"])
    )
    trajectory = experiment.run_many([70_001, 70_002, 70_003]).trajectory
    assert trajectory is not None
    plant = experiment.plant
    noise = trajectory["y1_rad"] - trajectory["x1_rad"] + plant.bias
    expected = plant.parameters.noise(experiment.scenario.sensors).tilt
    assert noise.std() == pytest.approx(expected, rel=0.03)
    assert abs(noise.mean()) < 4.0 * expected / math.sqrt(noise.size)
