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
    return np.concatenate([[0.0], run(estimator, y1)[0][:, 1]])


@pytest.mark.parametrize(("kind", "parameters", "denominator"), FILTERS)
@pytest.mark.parametrize("dt", [0.0005, DT, 0.02])
def test_equals_the_first_order_hold_of_its_transfer_function(
    kind: str, parameters: dict, denominator: Denominator, dt: float
) -> None:
    y1 = rough_signals(300, seed=1)[0] + 0.3
    num, den, *_ = cont2discrete(([1.0, 0.0], [*denominator, 1.0]), dt, "foh")
    expected = signal.lfilter(np.ravel(num), den, y1 - y1[0])
    np.testing.assert_allclose(rates(observer(kind, dt, **parameters), y1), expected, rtol=0.0, atol=1e-11)


def test_tilt_estimates_follow_the_same_filters() -> None:
    """z1 of (9) is y1/(tau s + 1)^2; x1 of the high-gain observer has the zero 1 + (a1 eps/a2) s as well."""
    y1 = rough_signals(300, seed=3)[0]
    t = np.arange(len(y1)) * DT
    for (kind, _, denominator), numerator in ((LINEAR, [1.0]), (BUTTERWORTH, [BUTTERWORTH[2][1], 1.0])):
        _, expected, _ = signal.lsim((numerator, [*denominator, 1.0]), y1 - y1[0], t, interp=True)
        ours = run(observer(kind), y1)[0][:, 0]
        np.testing.assert_allclose(ours, y1[0] + expected[1:], rtol=0.0, atol=1e-12)


def test_finite_difference_is_the_difference() -> None:
    y1, y2, u = rough_signals(50)
    estimates, _ = run(observer("finite_difference"), y1, y2, u)
    np.testing.assert_array_equal(estimates[:, 0], y1[1:])
    np.testing.assert_allclose(estimates[:, 1], np.diff(y1) * 200.0, rtol=1e-12)
    np.testing.assert_array_equal(estimates[:, 2], y2[1:])
