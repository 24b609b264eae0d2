"""The cheap gyro fused with y1, against the Riccati equation, whatever its offset, and on rigs that turn."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from cmg_mj.observers.gyro_free import GyroFree
from cmg_mj.results.baselines import GYROS, RATE_START, FusedGyro
from cmg_mj.results.summary_keys import open_loop_figures, section
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.sensors.gyros import MemsGyro
from tests.observers.reference import DT, NOISE
from tests.recorded import recorded

GYRO = MemsGyro()
SIGMA, WALK = GYRO.white_noise_sigma(DT), GYRO.flicker_floor
WORLDS = 200


def filter_of(tilt: float = NOISE.tilt) -> FusedGyro:
    return FusedGyro(SIGMA, WALK, [tilt] * WORLDS, DT)


def signals(ticks: int, seed: int, tilt: float = NOISE.tilt) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Any motion that starts at rest, its rate straight between samples: reading, y1, rate, bias, (ticks, WORLDS)."""
    rng = np.random.default_rng(seed)
    rate = 0.05 * np.cumsum(rng.normal(size=(ticks, WORLDS)), axis=0)
    rate[0] = 0.0
    x1 = np.vstack([np.zeros((1, WORLDS)), np.cumsum(0.5 * DT * (rate[1:] + rate[:-1]), axis=0)])
    bias = np.cumsum(WALK * math.sqrt(DT) * rng.normal(size=rate.shape), axis=0)
    white, noise = rng.normal(size=(2, *rate.shape))
    return rate + bias + SIGMA * white, x1 + tilt * noise, rate, bias


def riccati(tilt: float) -> float:
    """Variance of the bias' error by scipy, the white noise a state: each sample's enters two steps of the tilt."""
    F = np.array([[1.0, -DT, -0.5 * DT], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])  # of x1, b, n
    inputs = np.array(
        [[-0.5 * DT * WALK * math.sqrt(DT), -0.5 * DT * SIGMA], [WALK * math.sqrt(DT), 0.0], [0.0, SIGMA]]
    )
    C, R = np.array([[1.0, 0.0, 0.0]]), np.array([[tilt**2]])
    P = solve_discrete_are(F.T, C.T, inputs @ inputs.T, R)
    return float((P - P @ C.T @ np.linalg.solve(C @ P @ C.T + R, C @ P))[1, 1])


@pytest.mark.parametrize("tilt", [NOISE.tilt, 0.0005])
def test_the_error_of_the_bias_is_the_riccati_equations(tilt: float) -> None:
    reading, y1, rate, bias = signals(3000, 1, tilt)
    fused = filter_of(tilt)
    biases = reading - fused.rates(reading, y1)
    squares = np.square(biases - bias)[1500:].mean(axis=0)
    expected = riccati(tilt)
    standard_error = squares.std(ddof=1) / math.sqrt(WORLDS)
    assert abs(squares.mean() - expected) < 4.0 * standard_error < 0.15 * expected
    assert fused.covariance[2] == pytest.approx(expected, rel=0.01)
    # The rest of the rate's error is the reading's own noise.
    errors = reading - biases - rate
    assert np.square(errors)[1500:].mean() == pytest.approx(SIGMA**2 + expected, rel=0.05)


def test_no_offset_matters() -> None:
    reading, y1, *_ = signals(600, 2)
    plain = filter_of().rates(reading, y1)
    for offset in np.radians([-20.0, 0.3, 20.0]):
        np.testing.assert_allclose(filter_of().rates(reading + offset, y1), plain, atol=1e-9)


def test_it_starts_as_gyro_free_does() -> None:
    assert GyroFree.__dataclass_fields__["rate_start"].default == RATE_START


def test_a_perfect_y1_is_differentiated() -> None:
    reading, y1, rate, _ = signals(600, 4, 0.0)
    assert abs(filter_of(0.0).rates(reading, y1) - rate)[5:].max() < 6.0 * SIGMA


def test_in_a_run_each_gyro_is_better_than_the_one_before() -> None:
    result = prepare(load_scenario("push_recovery", ["duration_s=3.0"], "gyro_free")).run()
    errors = {name: result.mean("velocity_rms_error_rad_s", name) for name in GYROS}
    assert errors["mems_as_bought"] == pytest.approx(math.radians(20.0), rel=0.02)
    assert errors["mems_gyro"] is not None
    assert errors["mems_fused"] is not None
    assert errors["mems_gyro"] < 0.004
    assert errors["mems_fused"] < 0.006


def test_on_a_rig_that_turns_the_gyro_shows_the_bodys_rate() -> None:
    """Against MuJoCo's angular velocity of the frame, at the joint angles and rates of the run."""
    perfect = [f"sensors.mems_gyro.{name}=0" for name in ("noise_density_deg_s_rthz", "bias_instability_deg_h")]
    perfect += ["sensors.mems_gyro.scale_error=0", "sensors.mems_gyro.counts_per_deg_s=0", "plant.turn_rate_rad_s=2"]
    setup = prepare(load_scenario("two_axes", [*perfect, "push=[]", "duration_s=0.5", "plant.initial_tilt_deg=3"]))
    result = setup.run()
    trajectory, model = recorded(result), setup.plant.model
    data, velocity = mujoco.MjData(model), np.zeros(6)
    rates = np.stack([trajectory[name] for name in trajectory.layout.rates()], axis=-1)
    for axis in setup.plant.axes:
        body = []
        for q, v in zip(trajectory.qpos(), rates, strict=True):
            data.qpos[:], data.qvel[:] = q, v
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, axis.frame, velocity, 1)
            body.append(velocity[:3] @ axis.direction)
        difference = np.array(body) - trajectory[f"{axis.name}/x2_rad_s"]
        expected = math.sqrt(np.mean(difference**2))
        assert expected > 0.02  # 2 rad/s, leaning by 3 degrees about the other axis
        gyro = open_loop_figures(section(result.summaries[0], "axes")[axis.name])["mems_gyro"]
        assert gyro["velocity_rms_error_rad_s"] == pytest.approx(expected, rel=1e-9)
