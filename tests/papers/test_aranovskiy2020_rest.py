"""The rest of the rig of aranovskiy2020 with a biased observer in the law."""

from __future__ import annotations

import math

import pytest

from cmg_mj.papers.aranovskiy2020 import gains
from cmg_mj.papers.aranovskiy2020.paper import printed_model, settled_gains

SEED = 910_000


def test_the_rig_rests_at_zero_with_a_biased_observer() -> None:
    case = "(10), estimated angles"
    result = gains.find_rests([case], 4, SEED)[case]
    expected = gains.expected_integrator("ltv", math.radians(0.4))
    assert result.x2_estimated.high < -0.01  # biased it is
    assert result.is_at_zero(expected)
    assert not result.is_at_zero(-expected)  # the printed sign
    assert abs(result.x3.mean) < 2.0
    assert gains.laws_claim(result, result).verdict == "not reproduced"  # that is not the observer's rest


def test_bias_of_an_estimate_at_rest_in_closed_form() -> None:
    """(10): x2 = (M sin y1/J1) H11/H12 without noise. (11): noise adds to the bias, in (10) it does not."""
    model = printed_model()
    pull = model.gravity_torque * math.sin(-math.radians(0.5)) / model.J1
    h11, h12 = settled_gains()
    assert gains.steady("ltv", 0.5, 0.0)[1] == pytest.approx(pull * h11 / h12, rel=1e-6)
    assert gains.steady("ltv", 0.5, 0.007)[1] == pytest.approx(pull * h11 / h12, rel=0.02)
    quiet, noisy = (gains.steady("homogeneous", 0.5, sigma)[1] for sigma in (0.0, 0.007))
    assert noisy < 1.2 * quiet < 0.0
