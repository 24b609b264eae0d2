"""gyro_free against least squares over all samples, against scipy's Riccati equation, and in the trap of the offset."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import cmg_mj
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.observers import Measurement
from cmg_mj.observers.free_pivot import FreePivot
from cmg_mj.observers.gyro_free import GyroFree, State, steady_error
from tests.observers.double_integrator import INDEPENDENT, C, least_squares, motion, shares_of_y1
from tests.observers.reference import DT, NOISE, PAPER, run
from tests.recorded import push_recovery

NEVER: dict[str, Any] = {"innovation_weight": 0.0, "slow_innovation_weight": 0.0} | dict.fromkeys(
    ("gate", "pivot_s", "learn_s", "noise_s"), 1e12
)
"""Nothing is learnt and the gate is shut: a Kalman filter with the variances that it is told."""


def gyro_free(**parameters: Any) -> GyroFree:
    return GyroFree(DT, PAPER, NOISE, **parameters)


@pytest.mark.parametrize("n", [2, 3, 10, 60])
@pytest.mark.parametrize("pivot_moves", [False, True])
def test_with_nothing_to_learn_it_is_least_squares_over_all_samples(pivot_moves: bool, n: int) -> None:
    """A Kalman filter is that, step by step: any wrong term in means or covariances shows. free_pivot too."""
    fixed = {"bias_walk": 0.0, "jerk": 0.0}
    rng = np.random.default_rng(n)
    *_, y1, a = motion(n, rng, bias=0.4)
    if pivot_moves:
        estimator = FreePivot(DT, PAPER, NOISE, pivot_hz=5.0, slow_hz=5.0, pivot_start=0.03, **fixed, **NEVER)
        y1 = y1 + shares_of_y1(n, 0.03, 5.0, rng)
    else:
        estimator = gyro_free(**fixed)
    estimates, states = run(estimator, y1, a=a)
    x1, x2, w = least_squares(estimator, y1, a)
    np.testing.assert_allclose(estimates[-1, :2], (x1, x2), rtol=1e-7, atol=1e-10)
    if isinstance(estimator, FreePivot):
        f = math.exp(-2.0 * math.pi * estimator.pivot_hz * DT)
        assert states[-1].fast.w / f == pytest.approx(w, rel=1e-7, abs=1e-10)


def test_its_steady_state_is_that_of_the_riccati_equation() -> None:
    """p and z with correlated process and measurement noise; without a bias to find."""
    estimator = gyro_free(bias_start=1e-9, bias_walk=0.0, jerk=0.0)
    state = run(estimator, np.zeros(3000), a=0.0)[1][-1]
    A = np.array([[1.0, DT], [0.0, 1.0]])
    G = np.array([[DT**2], [DT]])  # n drives p and z by -G n
    H = np.array([[1.0, 0.0]])
    d, variance = DT**2 / 6.0, NOISE.acceleration**2
    R = (C - d) ** 2 * variance + INDEPENDENT**2
    S = -G * (C - d) * variance
    P = solve_discrete_are(A.T, H.T, G @ G.T * variance, np.array([[R]]), s=S)
    np.testing.assert_allclose([[state.pp, state.pz], [state.pz, state.zz]], P, rtol=1e-6)


def test_it_expects_5_mg_between_the_accelerometers_of_the_bundled_rig() -> None:
    plant = cmg_mj.load_plant()
    offset = plant.pair_tilt.acceleration(0.0, 0.0, 5e-3 * plant.gravity, 0.0)
    assert gyro_free().bias_start == pytest.approx(offset, rel=0.1)


class SteadyGains(GyroFree):
    """The same with the gains that it settles at, from the start."""

    def init(self, y: Measurement) -> State:
        rest, zero = Measurement(0.0, 0.0, 0.0), 0.0 * y.y1
        state = super().init(rest)
        for _ in range(4000):
            state, _ = super().step(state, rest, 0.0)
        p, z, b, *_ = super().init(y)
        return State(p, z, b, *(number + zero for number in state[3:]))


def figures(offset_mg: float, kind: str = "gyro_free", **parameters: float) -> float:
    """Mean velocity RMS error over worlds of push_recovery [rad/s]."""
    changes = [f"observer.kind={kind}", f"sensors.accelerometer.bias_mg=[0.0,{offset_mg}]", "duration_s=8.0"]
    changes += [f"observer.{name}={value}" for name, value in parameters.items()]
    result = cmg_mj.prepare(cmg_mj.load_scenario("push_recovery", changes)).run_many(8, keep_trajectory=False)
    return float(result.values("velocity_rms_error_rad_s").mean())


@pytest.mark.slow
def test_the_trap_of_the_offset() -> None:
    """Without an offset, leaving the bias out looks best; with 5 mg on one accelerometer only time-varying gains do."""
    no_bias: Any = {"bias_start": 1e-6, "bias_walk": 0.0}
    steady = f"{__name__}:SteadyGains"
    # Best without an offset: no state for it.
    assert figures(0.0, **no_bias) < figures(0.0) < 1.25 * figures(0.0, **no_bias)
    # With one, that is the worst by far, and steady gains, quick or slow, are in between.
    result = figures(5.0)
    assert result < 1.1 * figures(0.0)
    assert figures(5.0, **no_bias) > 4.0 * result
    for bias_walk in (0.03, 0.3):
        assert 1.2 * result < figures(5.0, steady, bias_walk=bias_walk) < 0.5 * figures(5.0, **no_bias)


@pytest.mark.parametrize(
    "noise",
    [MeasurementNoise(0.0063, 0.41, 0.87), MeasurementNoise(0.002, 2.5, 0.0), MeasurementNoise(0.04, 2.4, 0.95)],
)
def test_its_steady_error_is_that_of_samples_at_rest(noise: MeasurementNoise) -> None:
    rng, observer, state, rates = np.random.default_rng(8), GyroFree(DT, PAPER, noise), None, []
    for k in range(1200):
        v, other = rng.normal(size=(2, 100))
        n = noise.correlation * v + math.sqrt(1.0 - noise.correlation**2) * other
        y = Measurement(noise.tilt * v, 0.0 * v, noise.acceleration * n)
        if not k:
            state = observer.init(y)
        state, estimate = observer.step(state, y, 0.0 * v)
        rates.append(estimate.x2)
    assert np.sqrt(np.mean(np.square(rates[800:]))) == pytest.approx(steady_error(noise, DT), rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("places", [(0.0672, 0.2015), (0.05, 0.25), (0.1, 0.15), (0.16, 0.15, 0.1, -0.05)])
def test_check_foretells_its_error_by_the_accelerometers_places(places: tuple[float, ...]) -> None:
    fields = ("inner_m", "outer_m", "inner_across_m", "outer_across_m")
    settings = (f"plant.accelerometer_{field}={r}" for field, r in zip(fields, places, strict=False))
    experiment = push_recovery("seed=170000", "controller.feedback=truth", *settings, observer="gyro_free")
    error = experiment.run_many(24, keep_trajectory=False).mean("velocity_rms_error_rad_s")
    assert error == pytest.approx(steady_error(experiment.design.constructor_arguments[2], DT), rel=0.05)
