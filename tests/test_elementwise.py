"""Both branches of every elementwise function: right, and alike to the last bit."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from cmg_mj.core.arrays import atan2, clip, cos, digitise, exp, sign, signed_power, signed_powers, sin, sqrt, where

SPECIAL = [0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1e-300, -1e-300, 5e-324, 1e-9, -1e-9, 4.7, -4.7, 1e6, -1e6]

FUNCTIONS: list = [
    pytest.param(sin, id="sin"),
    pytest.param(cos, id="cos"),
    pytest.param(lambda x: sqrt(abs(x)), id="sqrt"),
    pytest.param(sign, id="sign"),
    pytest.param(lambda x: atan2(x, x + 1.0), id="atan2"),
    *(pytest.param(lambda x, a=a: signed_powers(x, a)[0], id=f"power {a}") for a in (0.85, 0.7, 0.51, 1.0)),
    *(pytest.param(lambda x, a=a: signed_powers(x, a)[1], id=f"second power {a}") for a in (0.85, 0.7, 0.51, 1.0)),
    pytest.param(lambda x: exp(-abs(x)), id="exp"),
    *(pytest.param(lambda x, a=a: signed_power(x, a), id=f"one power {a}") for a in (0.41, 1.0, 1.9, 10.0)),
    pytest.param(lambda x: clip(x, -4.7, 4.7), id="clip"),
    pytest.param(lambda x: where(x > 0.1, x, 2.0 * x), id="where"),
    pytest.param(lambda x: digitise(x, math.inf, 2.0 * math.pi / 4096.0), id="round"),
    pytest.param(lambda x: digitise(x, 2.0, 9.80665 / 16384.0), id="digitise"),
    pytest.param(lambda x: digitise(x, 3.0, 0.0), id="saturate"),
]


def numbers(scale: float) -> np.ndarray:
    return np.random.default_rng(7).normal(0.0, scale, 2001)


def bits(x: np.ndarray | float) -> np.ndarray:
    return (np.atleast_1d(np.asarray(x, dtype=float)) + 0.0).view(np.uint64)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_array_equals_floats_bit_by_bit(function: Callable) -> None:
    """But for the sign of a zero. Short arrays take other instructions than long ones."""
    for x in (np.array(SPECIAL), *(numbers(scale) for scale in (1e-12, 1e-3, 1.0, 30.0, 1e4))):
        singles = np.array([function(v) for v in x.tolist()])
        for n in (1, 2, 3, 7, 8, 9, len(x)):
            np.testing.assert_array_equal(bits(function(x[:n])), bits(singles[:n]))


@pytest.mark.parametrize("function", FUNCTIONS)
def test_one_world_stays_on_floats(function: Callable) -> None:
    """A NumPy scalar in a formula for one world would cost ten times as much from there on."""
    assert all(type(function(v)) is float for v in SPECIAL)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_world_that_is_nan_leaves_the_others_alone(function: Callable) -> None:
    many = function(np.array([0.3, math.nan, -2.0]))
    np.testing.assert_array_equal(many[[0, 2]], [function(0.3), function(-2.0)])


X = (-3.7, -0.02, 1e-5, 0.4, 9.0)


@pytest.mark.parametrize("x", X)
@pytest.mark.parametrize("a", [0.51, 0.7, 0.85, 1.0, 1.9, 10.0])
def test_signed_powers(x: float, a: float) -> None:
    """[x]^a = |x|^a sign x, together with that for 2a - 1."""
    expected = [np.sign(x) * abs(x) ** exponent for exponent in (a, 2.0 * a - 1.0)]
    assert signed_power(x, a) == pytest.approx(expected[0], rel=1e-14)
    if a <= 1.0:
        assert signed_powers(x, a) == pytest.approx(expected, rel=1e-14)


@pytest.mark.filterwarnings("ignore:overflow")
def test_a_power_that_is_too_large_is_infinite_on_both() -> None:
    assert signed_power(-1e200, 2.0) == -math.inf
    assert signed_power(np.array([-1e200, 1e200]), 2.0).tolist() == [-math.inf, math.inf]


@pytest.mark.parametrize("x", X)
def test_simple_functions(x: float) -> None:
    assert (sin(x), cos(x), sqrt(abs(x))) == (math.sin(x), math.cos(x), math.sqrt(abs(x)))
    assert exp(x) == math.exp(x)
    assert sign(x) == math.copysign(1.0, x)
    assert clip(x, -1.0, 2.0) == max(-1.0, min(2.0, x))
    assert where(x > 0.0, 5.0, 6.0) == (5.0 if x > 0.0 else 6.0)


@pytest.mark.parametrize("quarter", range(-3, 5))
def test_atan2_knows_all_quadrants(quarter: int) -> None:
    angle = quarter * math.pi / 4.0
    for y, x in ((math.sin(angle), math.cos(angle)), (1e-3 * math.sin(angle), 1e-3 * math.cos(angle))):
        assert atan2(y, x) == pytest.approx(angle, abs=1e-15)
        assert atan2(np.array([y]), np.array([x]))[0] == pytest.approx(angle, abs=1e-15)


def test_angle_of_the_origin_is_zero() -> None:
    """As the C library has it, and quietly: a rig in free fall shows no gravity."""
    assert atan2(0.0, 0.0) == 0.0
    assert atan2(np.zeros(2), np.zeros(2)).tolist() == [0.0, 0.0]


def test_sign_of_zero_is_zero() -> None:
    assert sign(0.0) == 0.0
    assert sign(np.zeros(2)).tolist() == [0.0, 0.0]


def test_digitise_saturates_then_rounds_half_to_even() -> None:
    x = np.array([0.24, 0.25, 0.26, 0.75, 1.24, -0.75, 7.0, -7.0])
    assert digitise(x, 2.0, 0.5).tolist() == [0.0, 0.0, 0.5, 1.0, 1.0, -1.0, 2.0, -2.0]
