"""The tilt rate that copies of the model find without a bias, and what a bias does to it, in closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tests.observers.reference import DT, GRAVITY_TORQUE, J1, PAPER, observer, power, run


@pytest.mark.parametrize(("kind", "most"), [("homogeneous", 5e-5), ("high_gain", 1e-4)])
def test_without_noise_and_bias_they_find_the_rate(kind: str, most: float) -> None:
    """Along a free motion of (4), the true x1, x3 measured."""
    u, dt = 0.5, 5e-4
    t = np.arange(0.0, 0.8, dt)

    def motion(s: float, x: np.ndarray) -> list[float]:
        return [x[1], PAPER.tilt_acceleration(float(x[0]), float(x[1]), u * s - 0.1, u)]

    x1, x2 = solve_ivp(motion, (0.0, 0.8), [-0.04, 0.25], "DOP853", t, rtol=1e-11, atol=1e-12).y
    error = np.abs(run(observer(kind, dt), x1, u * t - 0.1, u)[0][:, 1] - x2[1:])
    assert error[:10].min() > 0.1
    assert error[t[1:] > 0.7].max() < most


def homogeneous(alpha: float) -> Callable[[float], float]:
    """k2 [x1 - y1]^(2 alpha - 1) balances gravity, and x2 = k1 [x1 - y1]^alpha."""
    return lambda pull: 20.0 * power(pull / 150.0, alpha / (2.0 * alpha - 1.0))


def high_gain(d_inf: float) -> Callable[[float], float]:
    """L = 1: q2(l2 q1) balances gravity, and x2 = q1."""

    def rate(pull: float) -> float:
        def balance(q1: float) -> float:
            w = 12.4 * q1
            return w + (power(w, 1.0 + d_inf) if d_inf else 0.0) - pull

        return float(brentq(balance, -10.0, 10.0, xtol=1e-14))  # pyright: ignore[reportArgumentType]

    return rate


def ltv(pull: float) -> float:
    """H12 (y1 - x1) balances gravity, and x2 = H11 (x1 - y1)."""
    return pull * math.sqrt(1.0 + 2.0 * math.sqrt(5e6)) / math.sqrt(5e6)


@pytest.mark.parametrize("e_deg", [-1.0, 2.0])
@pytest.mark.parametrize(
    ("kind", "parameters", "rate", "rel"),
    [
        *(("homogeneous", {"alpha": alpha}, homogeneous(alpha), 1e-7) for alpha in (0.85, 0.7)),
        *(("high_gain", {"d_inf": d_inf}, high_gain(d_inf), 1e-6) for d_inf in (0.0, 0.3, 0.6)),
        ("ltv", {}, ltv, 1e-8),
    ],
)
def test_a_bias_leaves_the_rate_error_of_the_closed_form(
    kind: str, parameters: dict[str, Any], rate: Callable[[float], float], rel: float, e_deg: float
) -> None:
    """At rest y1 = -e, where gravity pulls as the model says."""
    y1 = -math.radians(e_deg)
    estimates, _ = run(observer(kind, **parameters), [y1] * 1200)
    assert estimates[-1, 1] == pytest.approx(rate(GRAVITY_TORQUE * math.sin(y1) / J1), rel=rel)


@pytest.mark.parametrize("e_deg", [-1.0, 2.0])
def test_a_bias_moves_tilt_and_rate_of_the_luenberger_observer(e_deg: float) -> None:
    """0 = x2 + l11 (y1 - x1) and 0 = w^2 x1 + l21 (y1 - x1), w^2 = m g l/(sqrt(2) J1)."""
    y1, w2 = -math.radians(e_deg), GRAVITY_TORQUE / J1
    expected = 150.0 * y1 / (150.0 - w2), 20.0 * w2 * y1 / (150.0 - w2)
    assert run(observer("luenberger"), [y1] * 800)[0][-1, :2] == pytest.approx(expected, rel=1e-9)


def test_a_bias_that_is_estimated_leaves_no_rate_error() -> None:
    """homogeneous_adaptive, whose bias is linear in e: sin y1 + e cos y1."""
    e = math.radians(1.5)
    estimates, _ = run(observer("homogeneous_adaptive"), [-e] * round(30.0 / DT))
    assert estimates[-1, 3] == pytest.approx(math.tan(e), rel=1e-6)
    assert abs(estimates[-1, 1]) < 1e-3 * homogeneous(0.85)(GRAVITY_TORQUE * math.sin(e) / J1)
