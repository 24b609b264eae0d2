"""gyro_free against least squares over all samples, against scipy's Riccati equation, and in the trap of the offset."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.stats import chi2

import cmg_mj
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import TiltNoise
from cmg_mj.observers import Measurement
from cmg_mj.observers.gyro_free import GyroFree, State
from tests.observers.double_integrator import integrator_rows
from tests.observers.reference import DT, NOISE, PAPER

C = NOISE.correlation * NOISE.tilt / NOISE.acceleration  # v = C n + what is independent of n


def gyro_free(noise: TiltNoise = NOISE, **parameters: Any) -> GyroFree:
    return GyroFree(DT, PAPER, noise, **parameters)


def motion(n: int, rng: np.random.Generator, bias: float, rate: float = 0.0) -> tuple[np.ndarray, ...]:
    """x1, x2 and alpha, which runs straight between samples, and what the sensors show of it: y1 and a."""
    alpha = 3.0 * np.sin(np.arange(n) * 0.11) + rng.normal(0.0, 0.5, n)
    x2 = rate + np.concatenate([[0.0], np.cumsum(0.5 * DT * (alpha[1:] + alpha[:-1]))])
    x1 = 0.02 + np.concatenate([[0.0], np.cumsum(DT * x2[:-1] + DT**2 * (alpha[:-1] / 3.0 + alpha[1:] / 6.0))])
    noise = rng.normal(0.0, NOISE.acceleration, n)
    other = rng.normal(0.0, NOISE.tilt * math.sqrt(1.0 - NOISE.correlation**2), n)
    return x1, x2, alpha, x1 + C * noise + other, alpha + bias + noise


def walk(estimator: GyroFree, y1: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, State]:
    """Estimates (x1, x2, x3) of the samples after the first, (n - 1, 3), and the last state."""
    state, rows = estimator.init(Measurement(y1[0], 0.0, a[0])), []
    for k in range(1, len(y1)):
        state, estimate = estimator.step(state, Measurement(y1[k], 0.0, a[k]), 0.0)
        rows.append(estimate)
    return np.array(rows), state


def least_squares(estimator: GyroFree, y1: np.ndarray, a: np.ndarray) -> tuple[float, float]:
    """x1 and x2 at the last sample that fit all samples and the start best, weighed by their standard deviations.

    Unknown are x1 and x2 at the first sample, b, and every sample's n; bias_walk and jerk are zero.
    """
    n = len(y1)
    unknown = 3 + n
    x1, x2, start = integrator_rows(y1, a, unknown, DT, estimator.rate_start, estimator.bias_start)
    n_rows = np.eye(n, unknown + 1, 3)
    reading = x1 + C * n_rows
    reading[:, -1] -= y1
    reading /= NOISE.tilt * math.sqrt(1.0 - NOISE.correlation**2)
    rows = np.vstack([reading, n_rows / NOISE.acceleration, start])
    solution = np.linalg.lstsq(rows[:, :-1], -rows[:, -1], rcond=None)[0]
    coefficients = np.append(solution, 1.0)
    return float(x1[-1] @ coefficients), float(x2[-1] @ coefficients)


@pytest.mark.parametrize("n", [2, 3, 10, 60])
def test_it_is_least_squares_over_all_samples(n: int) -> None:
    """A Kalman filter is that, step by step: any wrong term in means or covariances shows."""
    estimator = gyro_free(bias_walk=0.0, jerk=0.0)
    *_, y1, a = motion(n, np.random.default_rng(n), bias=0.4)
    estimates, _ = walk(estimator, y1, a)
    np.testing.assert_allclose(estimates[-1, :2], least_squares(estimator, y1, a), rtol=1e-7, atol=1e-10)


def test_its_steady_state_is_that_of_the_riccati_equation() -> None:
    """p and z with correlated process and measurement noise; without a bias to find."""
    estimator = gyro_free(bias_start=1e-9, bias_walk=0.0, jerk=0.0)
    zeros = np.zeros(3000)
    _, state = walk(estimator, zeros, zeros)
    A = np.array([[1.0, DT], [0.0, 1.0]])
    G = np.array([[DT**2], [DT]])  # n drives p and z by -G n
    H = np.array([[1.0, 0.0]])
    d, variance = DT**2 / 6.0, NOISE.acceleration**2
    R = (C - d) ** 2 * variance + NOISE.tilt**2 * (1.0 - NOISE.correlation**2)
    S = -G * (C - d) * variance
    P = solve_discrete_are(A.T, H.T, G @ G.T * variance, np.array([[R]]), s=S)
    np.testing.assert_allclose([[state.pp, state.pz], [state.pz, state.zz]], P, rtol=1e-6)


def test_its_covariance_is_what_its_errors_are() -> None:
    """Normalised errors of p, z, b over worlds with rates and biases as the start assumes, by a chi-square bound."""
    estimator = gyro_free(bias_walk=0.0, jerk=0.0)
    rng = np.random.default_rng(5)
    worlds, n, total = 300, 200, 0.0
    for _ in range(worlds):
        bias = rng.normal(0.0, estimator.bias_start)
        x1, x2, alpha, y1, a = motion(n + 1, rng, bias, rng.normal(0.0, estimator.rate_start))
        _, state = walk(estimator, y1[:-1], a[:-1])
        truth = x1[-1] - DT**2 / 6.0 * alpha[-1], x2[-1] - 0.5 * DT * alpha[-1], bias
        errors = np.subtract(truth, state[:3])
        pp, pz, pb, zz, zb, bb = state[3:]
        total += errors @ np.linalg.solve([[pp, pz, pb], [pz, zz, zb], [pb, zb, bb]], errors)
    low, high = chi2.ppf([0.001, 0.999], 3 * worlds)
    assert low < total < high


def test_it_expects_5_mg_between_the_accelerometers_of_the_bundled_rig() -> None:
    plant = cmg_mj.load_plant()
    offset = plant.radial_tilt.acceleration(0.0, 5e-3 * plant.gravity)
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
    mean = result.mean("velocity_rms_error_rad_s")
    assert mean is not None
    return mean


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


def test_without_a_measured_acceleration_it_is_refused() -> None:
    with pytest.raises(cmg_mj.InputError, match="needs the noise of its sensors"):
        cmg_mj.observers.make_observer("gyro_free", DT, ReducedModel(1.0, 0.0, 1.0, 1.0, 1.0))


def test_with_nothing_uncertain_it_is_refused() -> None:
    """Its covariance would fade to zero over zero after some hundred samples."""
    perfect = TiltNoise(0.0, 0.0, 0.9)
    gyro_free(perfect, jerk=0.0)
    with pytest.raises(ValueError, match="one of them must be positive"):
        gyro_free(perfect, jerk=0.0, bias_walk=0.0)
