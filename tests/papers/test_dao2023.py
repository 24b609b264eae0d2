"""dao2023's claims on statistics: other motions, seeds and counts than the report's."""

from __future__ import annotations

from functools import cache

import numpy as np

from cmg_mj.papers.dao2023 import figures
from cmg_mj.papers.dao2023 import pendulum_robot as robot


@cache
def study() -> figures.Study:
    """Ten other motions than the report's."""
    return figures.study(seed=7)


def test_conventional_state_error_keeps_oscillating_and_the_proposed_does_not() -> None:
    """Fig. 2."""
    plain, ours = figures.tail_rms(study().conventional)[0], figures.tail_rms(study().proposed)[0]
    print(f"state error RMS over 160-200 s: conventional {np.round(plain, 3)}, proposed {np.round(ours, 3)}")
    assert plain.min() > 0.2
    assert ours.max() < 0.1
    assert study().largest_angle > 100.0  # the motion that no two integrators agree on


def test_settling_order() -> None:
    """Fig. 3: 1000 before 10 before 0.1; and not before 10 on the way there, nor ever faster with Sigma."""
    ten, thousand, tenth, ten_thousand = figures.settle_times(study().proposed)
    print(f"settle below {figures.SETTLED}: Sigma 10 {ten}, 1000 {thousand}, 0.1 {tenth}, 10000 {ten_thousand}")
    assert np.sum((thousand < ten) & (ten <= tenth) & np.isfinite(thousand)) >= 9
    early = figures.settle_times(study().proposed, 1.0)
    assert np.sum(early[1] < early[0]) < 9
    assert np.median(ten_thousand) > 2.0 * np.median(thousand)


def test_state_error_does_not_settle_quickly() -> None:
    """Fig. 2(b): with all known, L alone needs some time constants of 2 s, the real part of s^2 + s + 1 = 0."""
    settled, known = figures.state_settle_times(study().proposed)
    print(f"state error below {figures.SETTLED}: {settled} s; with all known {known} s")
    size = np.linalg.norm(study().proposed.state[0, 0], axis=-1)
    expected = 2.0 * np.log(size / figures.SETTLED)
    assert np.all(np.abs(known - expected) < 3.0)
    assert np.median(settled) > figures.QUICK * np.median(known)


def test_parameters_at_sigma_1000() -> None:
    errors = np.abs(study().proposed.exogenous[-1, 1, :, :2])
    print(f"largest errors of theta1 and theta2: {errors.max(axis=0)}")
    assert errors.max() < 1e-3


def test_too_large_a_gain_is_slow_at_a_finer_step_too() -> None:
    """No effect of sampling: at 1 kHz Sigma = 10000 is no faster than at 400 Hz, and slower than 1000."""
    start, medians = robot.starts(11, 3), {}
    for rate in (400.0, 1000.0):
        t = np.arange(round(60.0 * rate) + 1) / rate
        errors = robot.follow(robot.proposed(1.0 / rate, (1000.0, 10_000.0)), t, robot.motion(start, t))
        size = np.linalg.norm(errors.exogenous[t > 50.0], axis=-1)
        medians[rate] = np.median(size, axis=(0, 2))
    print(f"median error over 50-60 s at Sigma = 1000 and 10000: {medians}")
    assert medians[400.0][1] > 3.0 * medians[400.0][0]
    assert medians[1000.0][1] > 3.0 * medians[1000.0][0]
    assert medians[1000.0][1] > 0.8 * medians[400.0][1]


def test_identity_and_upsilon_on_other_seeds() -> None:
    for seed in (1, 2):
        assert robot.identity_error(10.0, 4.0, seed)[0] < 1e-8
        assert robot.discrete_identity_error(1000.0, 0.005, 20.0, seed)[0] < 1e-8
        assert max(robot.upsilon_errors(10.0, 0.005, 10.0, seed)) < 1e-9


def test_identity_can_fail() -> None:
    """With a wrong exosystem, z does not go its own way."""
    t = np.linspace(0.0, 3.0, 7)
    x, guessed, xm, T = robot.continuous_run(10.0, robot.starts(0, 1)[0], np.ones(6), t, 1e-10)
    wrong = np.array([*robot.THETA, 1.0, 0.0])  # a disturbance that stands still
    z = guessed - x - np.einsum("kij,kj->ki", T, xm - wrong)
    right = guessed - x - np.einsum("kij,kj->ki", T, xm - robot.exosystem_state(t))
    assert np.abs(z - right).max() > 0.1


def test_settle_times() -> None:
    t = np.array([0.0, 1.0, 2.0, 3.0])
    sizes = np.array([[2.0, 0.0, 2.0, 0.5], [0.0, 0.0, 2.0, 2.0], [0.5, 0.0, 2.0, 0.0], [0.0, 0.0, 2.0, 0.0]])
    assert robot.settle_times(sizes, t, 1.0).tolist() == [1.0, 0.0, np.inf, 2.0]
