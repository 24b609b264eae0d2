"""The two linear differentiators against their transfer functions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import signal

from cmg_mj.observers import Observer
from tests.observers.reference import DT, EPSILON, observer, rough_signals, run

LINEAR = ("linear", {}, (0.02**2, 2 * 0.02))  # aranovskiy2020 (9), tau of Table 2
BUTTERWORTH = ("linear_high_gain", {}, (EPSILON**2, math.sqrt(2.0) * EPSILON))
FILTERS = [
    pytest.param(*LINEAR, id="linear"),
    pytest.param("linear", {"tau": 0.035}, (0.035**2, 2 * 0.035), id="linear, tau"),
    pytest.param(*BUTTERWORTH, id="high gain"),
    pytest.param("linear_high_gain", {"epsilon": 0.02}, (0.02**2, math.sqrt(2.0) * 0.02), id="high gain, epsilon"),
    pytest.param("linear_high_gain", {"epsilon": 0.02, "a1": 3.0}, (0.02**2, 3.0 * 0.02), id="high gain, a1"),
    pytest.param(
        "linear_high_gain",
        {"epsilon": 0.02, "a2": 2.5},
        (0.02**2 / 2.5, math.sqrt(2.0) * 0.02 / 2.5),
        id="high gain, a2",
    ),
]
"""Kind, parameters, and d2, d1 of s/(d2 s^2 + d1 s + 1)."""

Denominator = tuple[float, float]


cont2discrete: Any = signal.cont2discrete  # its annotations name every return at once


def rates(estimator: Observer, y1: np.ndarray) -> np.ndarray:
    """Estimates of x2 at every sample, the first one zero."""
    nothing = np.zeros(len(y1))
    return np.concatenate([[0.0], run(estimator, y1, nothing, nothing)[0][:, 1]])


@pytest.mark.parametrize(("kind", "parameters", "denominator"), FILTERS)
def test_equals_the_transfer_function_on_straight_pieces(kind: str, parameters: dict, denominator: Denominator) -> None:
    y1 = rough_signals(400)[0] + 0.3
    t = np.arange(len(y1)) * DT
    _, expected, _ = signal.lsim(([1.0, 0.0], [*denominator, 1.0]), y1 - y1[0], t, interp=True)
    np.testing.assert_allclose(rates(observer(kind, **parameters), y1), expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize(("kind", "parameters", "denominator"), FILTERS)
@pytest.mark.parametrize("dt", [0.0005, 0.02])
def test_equals_the_first_order_hold_at_other_rates(
    kind: str, parameters: dict, denominator: Denominator, dt: float
) -> None:
    y1 = rough_signals(300, seed=1)[0]
    num, den, *_ = cont2discrete(([1.0, 0.0], [*denominator, 1.0]), dt, "foh")
    expected = signal.lfilter(np.ravel(num), den, y1 - y1[0])
    np.testing.assert_allclose(rates(observer(kind, dt, **parameters), y1), expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize(("kind", "parameters", "denominator"), FILTERS)
@pytest.mark.parametrize("frequency_hz", [0.5, 3.0, 7.957747, 25.0])
def test_frequency_response(kind: str, parameters: dict, denominator: Denominator, frequency_hz: float) -> None:
    """Straight pieces of a sampled sine are a sine of amplitude sinc(f dt)^2, and its images far above.

    At 7.96 Hz, tau = 0.02 s has its corner: there (9) has the gain 1/(2 tau) and no phase.
    """
    dt, w = 5e-4, 2.0 * math.pi * frequency_hz
    t = np.arange(0.0, 1.2 + 1.0 / frequency_hz, dt)
    rate = rates(observer(kind, dt, **parameters), np.sin(w * t))
    steady = t > 1.2
    basis = np.stack([np.cos(w * t), np.sin(w * t)], axis=1)
    (cosine, sine), *_ = np.linalg.lstsq(basis[steady], rate[steady], rcond=None)
    expected = (
        1j * w / (denominator[0] * (1j * w) ** 2 + denominator[1] * 1j * w + 1.0) * np.sinc(frequency_hz * dt) ** 2
    )
    assert math.hypot(cosine, sine) == pytest.approx(abs(expected), rel=1e-6)
    assert math.atan2(cosine, sine) == pytest.approx(np.angle(expected), abs=1e-6)


@pytest.mark.parametrize(("kind", "parameters", "denominator"), FILTERS)
def test_a_ramp_gives_its_slope_without_error(kind: str, parameters: dict, denominator: Denominator) -> None:
    """Also at a sample period as long as the filter's own time."""
    del denominator
    for dt in (DT, 0.03):
        ramp = 0.1 - 0.7 * np.arange(0.0, 2.5, dt)
        rate = rates(observer(kind, dt, **parameters), ramp)
        assert rate[-1] == pytest.approx(-0.7, abs=1e-12)


def test_high_gain_with_2_and_1_is_the_linear_differentiator() -> None:
    y1 = rough_signals(300, seed=2)[0]
    for epsilon in (0.02, 0.05):
        ours = rates(observer("linear_high_gain", epsilon=epsilon, a1=2.0, a2=1.0), y1)
        np.testing.assert_allclose(ours, rates(observer("linear", tau=epsilon), y1), rtol=0.0, atol=1e-11)


def test_tilt_estimates_follow_the_same_filters() -> None:
    """z1 of (9) is y1/(tau s + 1)^2; x1 of the high-gain observer has the zero 1 + (a1 eps/a2) s as well."""
    y1 = rough_signals(300, seed=3)[0]
    t = np.arange(len(y1)) * DT
    for (kind, _, denominator), numerator in ((LINEAR, [1.0]), (BUTTERWORTH, [BUTTERWORTH[2][1], 1.0])):
        _, expected, _ = signal.lsim((numerator, [*denominator, 1.0]), y1 - y1[0], t, interp=True)
        ours = run(observer(kind), y1, 0.0 * y1, 0.0 * y1)[0][:, 0]
        np.testing.assert_allclose(ours, y1[0] + expected[1:], rtol=0.0, atol=1e-12)


def test_finite_difference_is_the_difference() -> None:
    y1, y2, u = rough_signals(50)
    estimates, _ = run(observer("finite_difference"), y1, y2, u)
    np.testing.assert_array_equal(estimates[:, 0], y1[1:])
    np.testing.assert_allclose(estimates[:, 1], np.diff(y1) * 200.0, rtol=1e-12)
    np.testing.assert_array_equal(estimates[:, 2], y2[1:])
