"""The time-invariant observer against sokolov2019 (9)."""

from __future__ import annotations

import math

import numpy as np
import pytest

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
