"""The robust exact differentiator against its own implicit equations and Levant's claims."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cmg_mj.observers import Measurement
from cmg_mj.observers.linear import TwistingState
from tests.observers.reference import BOUND, DT, observer, run

L, L0, L1 = 10.0, 1.5, 1.1
"""A bound to work with, and Levant's gains."""


@pytest.mark.parametrize(
    ("parameters", "values"),
    [
        pytest.param({}, (BOUND, L0, L1), id="defaults"),
        pytest.param({"L": 25.0}, (25.0, L0, L1), id="L"),
        pytest.param({"l0": 2.2}, (BOUND, 2.2, L1), id="l0"),
        pytest.param({"l1": 1.7}, (BOUND, L0, 1.7), id="l1"),
    ],
)
def test_each_step_solves_its_inclusion(parameters: dict, values: tuple[float, float, float]) -> None:
    """Backward Euler, with s = z0 - y1 after the step and xi in sign s:
    s + h l0 sqrt(L) |s|^(1/2) xi + h^2 l1 L xi = z0 + h z1 - y1 before it.
    """
    bound, l0, l1 = values
    estimator, rng = observer("super_twisting", **parameters), np.random.default_rng(5)
    n_sliding = 0
    for _ in range(200):
        z0, z1, y1 = rng.normal(0.0, 10.0 ** rng.uniform(-6.0, -1.0)), rng.normal(), 0.0
        z1 = z1 * 10.0 ** rng.uniform(-6.0, 0.0)
        state, estimate = estimator.step(TwistingState(z0, z1), Measurement(y1, 0.1), 0.0)
        s = state.z0 - y1
        xi = (z1 - state.z1) / (DT * l1 * bound)
        if s == 0.0:
            n_sliding += 1
            assert abs(xi) <= 1.0 + 1e-9
        else:
            assert xi == pytest.approx(math.copysign(1.0, s), abs=1e-8)
        left = s + DT * l0 * math.sqrt(bound * abs(s)) * xi + DT**2 * l1 * bound * xi
        assert left == pytest.approx(z0 + DT * z1 - y1, abs=1e-14)
        assert estimate == (state.z0, state.z1, 0.1)
    assert 20 < n_sliding < 180  # both branches were seen


def test_a_ramp_is_met_in_finite_time_and_held_without_chattering() -> None:
    n = 400
    ramp = 0.2 + 0.9 * DT * np.arange(n)
    estimates, _ = run(observer("super_twisting", L=L), ramp)
    is_settled = np.abs(estimates[:, 1] - 0.9) < 1e-10
    first = int(np.argmax(is_settled))
    assert 0 < first * DT < 0.5
    assert is_settled[first:].all()
    np.testing.assert_allclose(estimates[first:, 0], ramp[first + 1 :], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("second_derivative", [3.0, -8.0, 10.5])
def test_tracks_what_its_bound_allows(second_derivative: float) -> None:
    """|y''| < l1 L = 11: once sliding, s = 0 and the estimate is the last difference, behind by y'' h/2."""
    t = DT * np.arange(1200)
    estimates, _ = run(observer("super_twisting", L=L), second_derivative * t**2 / 2.0)
    lag = second_derivative * t[1:] - estimates[:, 1]
    np.testing.assert_allclose(lag[-200:], second_derivative * DT / 2.0, rtol=1e-8)


def test_loses_what_exceeds_its_bound() -> None:
    """z1 cannot move faster than l1 L = 11 rad/s^2: at y'' = 13 it falls behind by 2 rad/s each second."""
    t = DT * np.arange(800)
    estimates, _ = run(observer("super_twisting", L=L), 13.0 * t**2 / 2.0)
    lag = 13.0 * t[1:] - estimates[:, 1]
    np.testing.assert_allclose(np.diff(lag[200:]) / DT, 2.0, rtol=1e-9)
