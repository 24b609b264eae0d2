"""The time-invariant observer against sokolov2019 (9)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from tests.observers.reference import (
    GRAVITY_TORQUE,
    HEAVY,
    J1,
    PAPER,
    integrate,
    luenberger_slope,
    observer,
    rough_signals,
    run,
)

TABLE_II = ((20.0, 0.0), (150.0, 0.0), (0.0, 20.0))  # sokolov2019 Table II
CROSSED = ((31.0, 2.0), (240.0, -3.0), (1.5, 12.0))


@pytest.mark.parametrize(
    ("parameters", "L", "model"),
    [
        pytest.param({}, TABLE_II, PAPER, id="defaults"),
        pytest.param({"L": CROSSED}, CROSSED, PAPER, id="another L"),
        pytest.param({}, TABLE_II, HEAVY, id="another rig"),
    ],
)
def test_equals_the_continuous_observer(parameters: dict, L: tuple, model: ReducedModel) -> None:
    y1, y2, u = rough_signals(150)
    expected = integrate(luenberger_slope(L, model), [y1[0], 0.0, y2[0]], y1, y2, u)
    estimates, _ = run(observer("luenberger", model=model, **parameters), y1, y2, u)
    np.testing.assert_allclose(estimates, expected, rtol=0.0, atol=1e-10)


def test_error_poles_are_those_of_table_II() -> None:
    """(s^2 + 20 s + 150 - m g l/(sqrt(2) J1)) (s + 20)."""
    poles = np.linalg.eigvals(observer("luenberger").error_matrix)  # type: ignore[attr-defined]
    half = math.sqrt(100.0 - 150.0 + GRAVITY_TORQUE / J1)
    np.testing.assert_allclose(sorted(poles.real), [-20.0, -10.0 - half, -10.0 + half], rtol=1e-9)
    np.testing.assert_allclose(poles.imag, 0.0, atol=1e-12)


@pytest.mark.parametrize("e_deg", [0.5, -2.0])
def test_a_bias_leaves_a_rate_error_of_the_closed_form(e_deg: float) -> None:
    """At rest y1 = -e, 0 = x2 + l11 (y1 - x1) and 0 = w^2 x1 + l21 (y1 - x1), w^2 = m g l/(sqrt(2) J1)."""
    y1 = -math.radians(e_deg)
    w2 = GRAVITY_TORQUE / J1
    n = 800
    estimates, _ = run(observer("luenberger"), [y1] * n, [0.0] * n, [0.0] * n)
    assert estimates[-1, 1] == pytest.approx(20.0 * w2 * y1 / (150.0 - w2), rel=1e-9)
    assert estimates[-1, 0] == pytest.approx(150.0 * y1 / (150.0 - w2), rel=1e-9)


@pytest.mark.parametrize(
    "L",
    [
        pytest.param(((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)), id="none"),
        pytest.param(((20.0, 0.0), (55.0, 0.0), (0.0, 20.0)), id="less than the unstable pole asks for"),
        pytest.param(((20.0, 0.0), (150.0, 0.0), (0.0, 0.0)), id="third state not corrected"),
        pytest.param(((-20.0, 0.0), (150.0, 0.0), (0.0, 20.0)), id="sign"),
    ],
)
def test_a_gain_that_does_not_stabilise_is_refused_by_name(L: tuple) -> None:
    with pytest.raises(InputError, match=r"L: A - L C must be Hurwitz .+, its eigenvalues are .+luenberger"):
        observer("luenberger", L=L)


def test_a_gain_just_above_the_unstable_pole_is_taken() -> None:
    observer("luenberger", L=((20.0, 0.0), (56.5, 0.0), (0.0, 20.0)))  # m g l/(sqrt(2) J1) = 55.84
