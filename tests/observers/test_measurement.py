"""The observers' input: the paper's y, two angles, and the angular acceleration beside it."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

import cmg_mj
from cmg_mj.core.tilt import PairTilt
from cmg_mj.observers import Measurement

G = 9.81


def test_two_angles_unpack_and_the_acceleration_is_beside_them() -> None:
    y = Measurement(0.1, 0.2, 3.0)
    y1, y2 = y
    assert (y1, y2, y.y1, y.y2, y.acceleration, len(y)) == (0.1, 0.2, 0.1, 0.2, 3.0, 2)
    assert pickle.loads(pickle.dumps(y)).acceleration == 3.0
    assert math.isnan(Measurement(0.1, 0.2).acceleration)


def test_noise_and_correlation_are_those_of_random_readings() -> None:
    tilt_estimate, sigma = PairTilt(0.067, 0.201), 0.0392
    rng = np.random.default_rng(1)
    n = 200_000
    ix, iz, ox, oz = sigma * rng.standard_normal((4, n))
    y1, alpha = tilt_estimate(ix, G + iz, ox, G + oz), tilt_estimate.acceleration(ix, 0.0, ox, 0.0)
    noise = tilt_estimate.noise(sigma, G)
    assert y1.std() == pytest.approx(noise.tilt, rel=0.01)
    assert alpha.std() == pytest.approx(noise.acceleration, rel=0.01)
    assert np.corrcoef(y1, alpha)[0, 1] == pytest.approx(noise.correlation, abs=0.003)
    assert noise.correlation == pytest.approx(0.894, abs=0.001)  # r_outer = 3 r_inner: 2/sqrt(5)


def test_the_rig_measures_its_angular_acceleration() -> None:
    """Perfect accelerometers: the second derivative of the true tilt, by central differences of the true rate."""
    perfect = ["sensors.accelerometer.noise_density_ug_rthz=0", "sensors.accelerometer.counts_per_g=0"]
    scenario = cmg_mj.load_scenario("push_recovery", [*perfect, "controller.feedback=truth", "duration_s=4"])
    run = cmg_mj.prepare(scenario).run().trajectory
    assert run is not None
    smooth = (run["time_s"] > 2.15) & (run["time_s"] < 3.9)  # after the push, whose edges are steps
    expected = np.gradient(run["x2_rad_s"], run["time_s"])
    # The servo's commands change at every tick, so that the acceleration jumps there: compare means over many ticks.
    error = (run["acceleration_rad_s2"] - expected)[smooth]
    assert np.abs(error).mean() < 0.1 * np.abs(expected[smooth]).mean()
    assert abs(error.mean()) < 0.01
