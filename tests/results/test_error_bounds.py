"""The floors: what they are worth, against other ways to find them, and that the filter that fits reaches them."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import lfilter

from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.observers import Measurement, make_observer
from cmg_mj.results.floors import ROWS_A_TAP, TiltFloor, acceleration_floor
from tests.observers.reference import DT, NOISE, PAPER

WHOLE = 2000


def test_no_noise_no_floor() -> None:
    assert acceleration_floor(MeasurementNoise(0.0, 0.0, 0.9), DT) == 0.0


def accelerate(noise: MeasurementNoise, runs: int, ticks: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Any motion whose acceleration runs straight between samples: y1, measured acceleration, rate, (ticks, runs)."""
    rng = np.random.default_rng(seed)
    a = np.cumsum(rng.normal(0.0, 3.0, (ticks, runs)), axis=0)
    before = np.vstack([a[:1], a[:-1]])
    rate = np.cumsum(DT * (before + a) / 2.0, axis=0)
    rate_before = np.vstack([np.zeros((1, runs)), rate[:-1]])
    tilt = np.cumsum(DT * rate_before + DT**2 * (2.0 * before + a) / 6.0, axis=0)
    r = noise.correlation
    n, noise_y1 = rng.standard_normal((2, ticks, runs))
    return tilt + noise.tilt * (r * n + math.sqrt(1.0 - r * r) * noise_y1), a + noise.acceleration * n, rate


def squared_errors(noise: MeasurementNoise) -> np.ndarray:
    """Mean square, once settled, of a filter that is told some noise, on any motion and NOISE, (runs,)."""
    parameters = {"rate_start": 1.0, "bias_start": 1e-9, "bias_walk": 0.0, "jerk": 0.0}
    estimator = make_observer("gyro_free", DT, PAPER, noise, **parameters)
    y1, a, rate = accelerate(NOISE, 800, 1500, seed=4)
    zero = 0.0 * y1[0]
    state, errors = estimator.init(Measurement(y1[0], zero, a[0])), []
    for k in range(1, len(y1)):
        state, estimate = estimator.step(state, Measurement(y1[k], zero, a[k]), zero)
        errors.append(estimate.x2 - rate[k])
    return np.square(errors[500:]).mean(axis=0)


def standard_error(values: np.ndarray) -> float:
    return float(values.std(ddof=1)) / math.sqrt(len(values))


def test_the_matched_filter_reaches_the_floor_with_acceleration() -> None:
    squares = squared_errors(NOISE)
    floor = acceleration_floor(NOISE, DT) ** 2
    assert abs(squares.mean() - floor) < 4.0 * standard_error(squares) < 0.04 * floor


def inputs(y1: np.ndarray, edges: list[int]) -> np.ndarray:
    """Sum y1 over the shares of the past of each sample, one by one, (n_rows, n_worlds, n_taps)."""
    past = np.vstack([np.repeat(y1[:1], edges[-1], axis=0), y1])
    shares = [
        [past[edges[-1] + k - older + 1 : edges[-1] + k - newer + 1].sum(axis=0) for newer, older in pairwise(edges)]
        for k in range(len(y1))
    ]
    return np.moveaxis(np.array(shares), 1, 2)


def test_floor_of_y1_is_the_least_squares_fit() -> None:
    """In pieces, of which one world sees the first two, against NumPy's fit of all rows."""
    rng = np.random.default_rng(5)
    y1, x2 = rng.normal(0.0, 0.01, (2, 600, 2)) + 0.02
    run_mask = np.ones((600, 2), dtype=bool)
    run_mask[400:, 1] = False
    push_mask = run_mask & (np.arange(600)[:, None] >= 100)
    push_mask[350:] = False
    floor = TiltFloor(DT, 2)
    y1[450:, 1] = np.nan
    for k in range(0, 600, 256):
        floor.add(*(signal[k : k + 256] for signal in (y1, x2, run_mask, push_mask)))
    matrix = inputs(y1, floor.edges)
    for world in range(2):
        for result, mask in zip(floor.errors(world), (run_mask, push_mask), strict=True):
            rows = mask[:, world]
            taps = np.linalg.lstsq(matrix[rows, world], x2[rows, world], rcond=None)[0]
            residual = matrix[rows, world] @ taps - x2[rows, world]
            assert result == pytest.approx(math.sqrt(np.mean(residual**2)), rel=1e-6)


def floors_of(y1: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Floor of y1 of every run, (runs,) [rad/s]."""
    floor, rows = TiltFloor(DT, rate.shape[1]), np.ones(rate.shape, dtype=bool)
    floor.add(y1, rate, rows, rows)
    return np.array([floor.errors(world)[0] for world in range(rate.shape[1])], dtype=float)


def swing(runs: int, seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """A tilt that white torque swings, y1 and rate (ticks, runs), and the error of the filter that knows all of it."""
    rng = np.random.default_rng(seed)
    F = expm(np.array([[0.0, 1.0], [-40.0, -8.0]]) * DT)
    input_vector, sigma = np.array([0.0, 0.05]), 2e-3
    C = np.array([[1.0, 0.0]])
    P = solve_discrete_are(F.T, C.T, np.outer(input_vector, input_vector), [[sigma**2]])
    covariance = P - P @ C.T @ C @ P / (P[0, 0] + sigma**2)
    # The rate of x+ = F x + into w, as a filter of w.
    poles = np.poly(np.linalg.eigvals(F))
    responses = [input_vector, F @ input_vector]
    w = rng.standard_normal((WHOLE + 500, runs))
    signals = []
    for part in (0, 1):
        b = [0.0, responses[0][part], responses[1][part] + poles[1] * responses[0][part]]
        signals.append(lfilter(b, poles, w, axis=0)[500:])
    tilt, rate = signals
    return tilt + rng.normal(0.0, sigma, tilt.shape), rate, math.sqrt(covariance[1, 1])


def test_the_matched_filter_reaches_the_floor_of_y1() -> None:
    """No filter is better than Kalman's on a linear system with white noise, and the fit comes to within a per cent."""
    y1, rate, best = swing(40, seed=6)
    result = math.sqrt(np.mean(floors_of(y1, rate) ** 2))
    assert 0.98 * best < result < 1.01 * best < 0.6 * rate.std()


def test_too_few_samples_make_no_floor() -> None:
    rng = np.random.default_rng(8)
    for enough in (False, True):
        floor = TiltFloor(DT, 1)
        rows = ROWS_A_TAP * (len(floor.edges) - 1) - (not enough)
        y1, x2 = rng.standard_normal((2, rows, 1))
        floor.add(y1, x2, np.ones_like(x2, dtype=bool), np.zeros_like(x2, dtype=bool))
        run_floor, push_floor = floor.errors(0)
        assert (run_floor is not None) == enough
        assert push_floor is None
