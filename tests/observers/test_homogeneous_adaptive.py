"""The homogeneous differentiator that is told the bias: both its parts, and what the bias costs without it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.observers import Measurement
from tests.observers.reference import DT, GRAVITY_TORQUE, J1, observer, rough_signals


def test_is_adaptive_and_then_the_homogeneous_one_with_its_bias() -> None:
    both: Any = observer("homogeneous_adaptive", k1=25.0, alpha=0.9, Sigma=7.0, L=(-30.0, -200.0), Gamma=0.5)
    adaptive: Any = observer("adaptive", Sigma=7.0, L=(-30.0, -200.0), Gamma=(0.5, 1.0, 1.0))
    homogeneous: Any = observer("homogeneous", k1=25.0, alpha=0.9)
    y1, y2, u = (signal.tolist() for signal in rough_signals(80))
    first = Measurement(y1[0], y2[0])
    state, a, b = both.init(first), adaptive.init(first), homogeneous.init(first)
    estimate: Any = None
    for k in range(1, 80):
        y = Measurement(y1[k], y2[k])
        state, estimate = both.step(state, y, u[k - 1])
        a, result = adaptive.step(a, y, u[k - 1])
        b, expected = homogeneous.step(b, y, u[k - 1], result.bias_rad)
        assert tuple(estimate) == (*expected, result.bias_rad)
    assert estimate.bias_rad != 0.0


def test_the_bias_leaves_no_rate_error() -> None:
    """At rest at y1 = -e, (11) errs by k1 (M sin e/J1/k2)^(alpha/(2 alpha - 1)); this one does not."""
    e, alpha = math.radians(1.5), 0.85
    y = Measurement(-e, 0.0)
    rates = {}
    for kind in ("homogeneous", "homogeneous_adaptive"):
        estimator = observer(kind)
        state: Any = estimator.init(y)
        estimate: Any = None
        for _ in range(round(30.0 / DT)):
            state, estimate = estimator.step(state, y, 0.0)
        rates[kind] = estimate[1]
        if kind == "homogeneous_adaptive":
            assert estimate[3] == pytest.approx(math.tan(e), rel=1e-6)  # it is linear in e: sin y1 + e cos y1
    left = 20.0 * (GRAVITY_TORQUE * math.sin(e) / J1 / 150.0) ** (alpha / (2.0 * alpha - 1.0))
    assert abs(rates["homogeneous"]) == pytest.approx(left, rel=1e-3)
    assert abs(rates["homogeneous_adaptive"]) < 1e-3 * left


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"alpha": 0.5}, r"observer\.alpha"),
        ({"L": (1.0, -2.0)}, "Hurwitz"),
        ({"Gamma": 0.0}, r"observer\.Gamma"),
        ({"Sigma": np.nan}, r"observer\.Sigma"),
    ],
)
def test_what_either_part_refuses_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        observer("homogeneous_adaptive", **arguments)
