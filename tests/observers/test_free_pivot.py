"""free_pivot against gyro_free, least squares over all samples and matrices, and what it learns of noise and pivot."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import cmg_mj
from cmg_mj.core.tilt import TiltNoise
from cmg_mj.observers import Measurement, make_observer
from cmg_mj.observers.free_pivot import FreePivot, State
from tests.observers.double_integrator import integrator_rows
from tests.observers.reference import DT, NOISE, PAPER
from tests.observers.test_gyro_free import gyro_free, motion
from tests.observers.test_gyro_free import walk as walk_gyro_free

C = NOISE.correlation * NOISE.tilt / NOISE.acceleration
NEVER: dict[str, Any] = {"pivot_s": 1e12, "learn_s": 1e12, "noise_s": 1e12}
"""Nothing is learnt: a Kalman filter with the variances that it is told."""


def free_pivot(**parameters: Any) -> FreePivot:
    return FreePivot(DT, PAPER, NOISE, **parameters)


def walk(estimator: FreePivot, y1: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, list[State]]:
    """Estimates (x1, x2, x3) of the samples after the first, and all states."""
    rest = 0.0 * y1[0]
    states, rows = [estimator.init(Measurement(y1[0], rest, a[0]))], []
    for k in range(1, len(y1)):
        state, estimate = estimator.step(states[-1], Measurement(y1[k], rest, a[k]), 0.0)
        states.append(state)
        rows.append(estimate)
    return np.array(rows), states


def shares_of_y1(n: int, sigma: float, hz: float, rng: np.random.Generator) -> np.ndarray:
    """Make the part of y1 that a moving pivot adds: first-order noise."""
    f, w = math.exp(-2.0 * math.pi * hz * DT), [rng.normal(0.0, sigma)]
    for _ in range(n - 1):
        w.append(f * w[-1] + rng.normal(0.0, sigma * math.sqrt(1.0 - f * f)))
    return np.array(w)


def test_while_the_pivot_rests_it_is_gyro_free() -> None:
    """With no variance of the pivot's, and noise that the datasheet covers."""
    x1, _, alpha, y1, a = motion(400, np.random.default_rng(1), bias=0.3)
    y1, a = x1 + 0.5 * (y1 - x1), alpha + 0.3 + 0.5 * (a - alpha - 0.3)
    estimates, states = walk(free_pivot(pivot_start=0.0, pivot_floor=0.0), y1, a)
    expected, _ = walk_gyro_free(gyro_free(bias_start=0.5), y1, a)
    assert max(state.scale for state in states) <= 1.0
    np.testing.assert_allclose(estimates, expected, rtol=0.0, atol=1e-12)


def least_squares(estimator: FreePivot, y1: np.ndarray, a: np.ndarray) -> tuple[float, float, float]:
    """x1, x2 and w at the last sample that fit all samples and the start best, weighed by their standard deviations.

    Unknown are x1 and x2 at the first sample, b, and every sample's n and w; bias_walk and jerk are zero.
    """
    n = len(y1)
    unknown = 3 + 2 * n
    x1, x2, start = integrator_rows(y1, a, unknown, DT, estimator.rate_start, estimator.bias_start)
    noise, w = np.eye(n, unknown + 1, 3), np.eye(n, unknown + 1, 3 + n)
    f, sigma = math.exp(-2.0 * math.pi * estimator.pivot_hz * DT), estimator.pivot_start
    reading = x1 + w + C * noise
    reading[:, -1] -= y1
    reading /= NOISE.tilt * math.sqrt(1.0 - NOISE.correlation**2)
    renewed = (w[1:] - f * w[:-1]) / (sigma * math.sqrt(1.0 - f * f))
    rows = np.vstack([reading, noise / NOISE.acceleration, start, w[:1] / sigma, renewed])
    solution = np.append(np.linalg.lstsq(rows[:, :-1], -rows[:, -1], rcond=None)[0], 1.0)
    return float(x1[-1] @ solution), float(x2[-1] @ solution), float(w[-1] @ solution)


@pytest.mark.parametrize("n", [2, 3, 10, 60])
def test_with_nothing_to_learn_it_is_least_squares_over_all_samples(n: int) -> None:
    """Any wrong term in means or covariances shows."""
    estimator = free_pivot(bias_walk=0.0, jerk=0.0, pivot_start=0.03, surprise=0.0, **NEVER)
    rng = np.random.default_rng(n)
    *_, y1, a = motion(n, rng, bias=0.4)
    y1 = y1 + shares_of_y1(n, 0.03, 5.0, rng)
    estimates, states = walk(estimator, y1, a)
    x1, x2, w = least_squares(estimator, y1, a)
    np.testing.assert_allclose(estimates[-1, :2], (x1, x2), rtol=1e-7, atol=1e-10)
    f = math.exp(-2.0 * math.pi * estimator.pivot_hz * DT)
    assert states[-1].w / f == pytest.approx(w, rel=1e-7, abs=1e-10)


def by_matrices(y1: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimates of x1, x2 and the learnt S of the samples after the first, in rad and seconds, by textbook matrices.

    States are p, z, b, w and the sample's n. The numbers are those of docs/assumptions.md.
    """
    f, d, H = math.exp(-2.0 * math.pi * 5.0 * DT), DT**2 / 6.0, np.array([1.0, 0.0, -(DT**2) / 6.0, 1.0, 0.0])
    H[4] = C - d
    F = np.diag([1.0, 1.0, 1.0, f, 0.0])
    F[:2, 1:] = [[DT, -(DT**2), 0.0, -(DT**2)], [1.0, -DT, 0.0, -DT]]
    drive = np.array([DT**2, DT, 0.0, 0.0, 0.0])
    x, P = np.array([y1[0] - d * a[0], 0.0, 0.0, 0.0, 0.0]), np.diag([1.0, 0.02**2, 0.5**2, 0.002**2, 0.0])
    r, S, share, bends = 1.0, 0.002**2, DT / 0.05, np.diff(np.append([y1[0]] * 2, y1), 2)
    rows, variances = [], []
    for k in range(len(y1)):
        r += DT / 0.3 * (bends[k] ** 2 / (6.0 * NOISE.tilt**2) - r)
        P[4, 4] = max(r, 1.0) * NOISE.acceleration**2
        e, ee = y1[k] - d * a[k] - H @ x, H @ P @ H + max(r, 1.0) * NOISE.tilt**2 * (1.0 - NOISE.correlation**2)
        K = P @ H / ee
        x, P = x + K * e, P - np.outer(K, H @ P)
        alpha = a[k] - x[2] - x[4]
        rows.append((x[0] + d * alpha, x[1] + 0.5 * DT * alpha))
        rise = share * (x[3] ** 2 + P[3, 3] - S + 4.0 * S * (e**2 / ee - 1.0))
        early = share * max(rise, 0.0)
        S = max(S + rise + 60.0 * early, 0.001**2)
        P += 10.0 * early * np.outer([1.0, 0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, -1.0, 0.0])
        P[:2, :2] *= 1.0 + 10.0 * early / (S + NOISE.tilt**2)
        share = max(share / (1.0 + share), DT / 1.0)
        x, P = F @ x + drive * a[k], F @ P @ F.T + 0.1**2 * np.outer(drive, drive)
        P[2, 2] += 0.01**2 * DT
        P[3, 3] += (1.0 - f * f) * S
        variances.append(S)
    return np.array(rows[1:]), np.array(variances[1:])


@pytest.mark.parametrize("sigma", [0.0, 0.03])
def test_it_is_its_equations_in_matrices(sigma: float) -> None:
    """Learning included, with the defaults."""
    rng = np.random.default_rng(8)
    *_, y1, a = motion(300, rng, bias=0.4)
    y1 = y1 + shares_of_y1(300, sigma, 5.0, rng)
    estimates, states = walk(free_pivot(), y1, a)
    expected, variances = by_matrices(y1, a)
    np.testing.assert_allclose(estimates[:, :2], expected, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose([state.pivot for state in states[1:]], variances, rtol=1e-7)


def test_a_rise_at_the_start_adds_to_the_doubt_about_the_tilt() -> None:
    """Without it the error in the first one and a half seconds on a strong pivot is larger by a tenth."""
    rng = np.random.default_rng(9)
    worlds, n = 60, 300
    _, x2, _, y1, a = np.transpose([motion(n, rng, bias=0.0) for _ in range(worlds)], (1, 2, 0))
    y1 = y1 + np.transpose([shares_of_y1(n, 0.05, 15.0, rng) for _ in range(worlds)])
    estimates = (walk(free_pivot(**doubt), y1, a)[0][:, 1] for doubt in ({}, {"doubt": 0.0}))
    errors, without = (math.sqrt(np.square(estimate - x2[1:]).mean()) for estimate in estimates)
    assert errors < 0.9 * without


@pytest.mark.parametrize("hz", [1.0, 5.0, 15.0])
def test_it_learns_how_strongly_the_pivot_moves(hz: float) -> None:
    """The standard deviation of w, mean over the last five of eight seconds, to a third; nothing at rest."""
    rng = np.random.default_rng(3)
    *_, y1, a = motion(1600, rng, bias=0.2)
    at_rest, moving = (
        math.sqrt(np.mean([state.pivot for state in walk(free_pivot(), y1 + w, a)[1][600:]]))
        for w in (np.zeros(1600), shares_of_y1(1600, 0.05, hz, rng))
    )
    assert at_rest < 0.005
    assert moving == pytest.approx(0.05, rel=0.35)


def test_without_noise_the_expected_motion_falls_to_its_floor() -> None:
    """0.01 m/s^2, a fifth of the weakest motion of the grid."""
    zeros = np.zeros(300)
    _, states = walk(free_pivot(), zeros, zeros)
    assert 9.81 * math.sqrt(states[-1].pivot) == pytest.approx(0.01, rel=0.05)


def test_it_does_not_take_vibration_for_the_pivots_motion() -> None:
    """Noise of thrice the datasheet's has nine times its variance."""
    x1, _, alpha, y1, a = motion(1600, np.random.default_rng(4), bias=0.0)
    _, states = walk(free_pivot(), x1 + 3.0 * (y1 - x1), alpha + 3.0 * (a - alpha))
    assert np.mean([state.scale for state in states[400:]]) == pytest.approx(9.0, rel=0.2)
    assert math.sqrt(np.mean([state.pivot for state in states[400:]])) < 0.01


def test_without_a_measured_acceleration_it_is_refused() -> None:
    with pytest.raises(cmg_mj.InputError, match="needs the noise of its sensors"):
        make_observer("free_pivot", DT, PAPER)


def test_with_nothing_uncertain_it_is_refused() -> None:
    perfect = TiltNoise(0.0, 0.0, 0.9)
    FreePivot(DT, PAPER, perfect, jerk=0.1, bias_walk=0.0)
    with pytest.raises(ValueError, match="one of them must be positive"):
        FreePivot(DT, PAPER, perfect, jerk=0.0, bias_walk=0.0)


PIVOT = 'pivot=[{kind="noise", acceleration_m_s2=0.5, corner_hz=5.0}]'
OFFSET = "sensors.accelerometer.bias_mg=[0.0,5.0]"
WORLDS = 24


@cache
def side_by_side(*settings: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times, and the squared errors of both in open loop on the same worlds, (n_ticks, WORLDS)."""
    open_loop = "seed=160000", "controller.feedback=truth", 'open_loop_observers=["free_pivot"]'
    scenario = cmg_mj.load_scenario("push_recovery", [*open_loop, *settings], "gyro_free")
    result = cmg_mj.prepare(scenario).run_many(WORLDS)
    t = result.trajectory
    assert result.stood.all()
    assert t is not None
    names = ("gyro_free", "free_pivot")
    return t["time_s"], {name: np.square(t[f"estimate/{name}/x2_rad_s"] - t["x2_rad_s"]) for name in names}


def errors_of(squares: dict[str, np.ndarray], part: slice | np.ndarray = slice(None)) -> dict[str, np.ndarray]:
    """Velocity RMS error of every world [rad/s]."""
    return {name: np.sqrt(square[part].mean(axis=0)) for name, square in squares.items()}


@pytest.mark.slow
def test_at_rest_it_loses_nothing_to_gyro_free() -> None:
    """In the mean at most a hundredth, in no world more than a tenth."""
    errors = errors_of(side_by_side()[1])
    assert errors["free_pivot"].mean() < 1.01 * errors["gyro_free"].mean()
    assert (errors["free_pivot"] < 1.1 * errors["gyro_free"]).all()


@pytest.mark.slow
def test_on_a_strong_pivot_it_has_at_most_035_of_the_error() -> None:
    """Over all worlds; and less than half of it in each of them."""
    errors = errors_of(side_by_side(PIVOT)[1])
    assert errors["free_pivot"].mean() < 0.35 * errors["gyro_free"].mean()
    assert (errors["free_pivot"] < 0.6 * errors["gyro_free"]).all()


@pytest.mark.slow
@pytest.mark.parametrize(("settings", "most"), [((OFFSET,), 1.2), ((PIVOT,), 2.38)])
def test_after_a_second_it_has_settled_as_far_as_it_can(settings: tuple[str, ...], most: float) -> None:
    """On a pivot of 0.5 m/s^2 by the bound of docs/studies/free_pivot_grid.py, which exceeds 1.2 itself."""
    time, squares = side_by_side(*settings)
    early, late = (squares["free_pivot"][part].mean() for part in ((time >= 1.0) & (time < 1.5), time >= 8.0))
    assert math.sqrt(early / late) < most


def loop(kind: str, *settings: str) -> float:
    """Mean velocity RMS error over worlds of push_recovery, the observer in its loop [rad/s]."""
    scenario = cmg_mj.load_scenario("push_recovery", ["seed=150000", *settings], kind)
    result = cmg_mj.prepare(scenario).run_many(8, keep_trajectory=False)
    assert result.stood.all()
    mean = result.mean("velocity_rms_error_rad_s")
    assert mean is not None
    return mean


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setting", "most"),
    [
        ("seed=150000", 1.05),
        ('pivot=[{kind="noise", acceleration_m_s2=0.5, corner_hz=5.0}]', 0.4),
        ('pivot=[{kind="noise", acceleration_m_s2=0.2, corner_hz=1.0}]', 0.9),
        ('pivot=[{kind="sine", acceleration_m_s2=0.7, frequency_hz=3.0}]', 0.3),
        ("sensors.accelerometer.misalignment_deg=[0.0,1.0]", 1.2),
        ("sensors.accelerometer.vibration_mg=20", 1.1),
    ],
)
def test_in_the_loop_it_keeps_to_its_share_of_gyro_free(setting: str, most: float) -> None:
    """docs/studies/free_pivot_grid.py has all cells on 100 worlds."""
    assert loop("free_pivot", setting) < most * loop("gyro_free", setting)


def test_without_noise_the_pivots_variance_has_a_floor() -> None:
    """Without one y1 would have no variance at all, by which a rise is divided."""
    silent = TiltNoise(0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="pivot_floor = 0: with sensors without noise it must be positive"):
        FreePivot(DT, PAPER, silent, pivot_start=0.0, pivot_floor=0.0)
    *_, y1, a = motion(50, np.random.default_rng(3), bias=0.0)
    estimates, _ = walk(FreePivot(DT, PAPER, silent, pivot_start=0.0, pivot_floor=1e-6), y1, a)
    assert np.isfinite(estimates).all()
