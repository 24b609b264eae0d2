"""(9) of aranovskiy2020, its lag and noise, and (11), where its error converges to, and when."""

from __future__ import annotations

import math

import pytest

from cmg_mj.papers.aranovskiy2020 import differentiators

SEED = 910_000


@pytest.mark.parametrize("tau", [0.01, 0.02, 0.05])
def test_lag_and_noise_of_the_linear_differentiator(tau: float) -> None:
    late, noise_gain = differentiators.trade(tau, SEED)
    assert late == pytest.approx(2.0 * tau, rel=1e-3)
    assert noise_gain == pytest.approx(differentiators.predict_trade(tau)[1], rel=0.04)
    assert differentiators.lag(SEED).verdict == "reproduced"


def test_vicinity_of_the_homogeneous_differentiator() -> None:
    claim = differentiators.vicinity(SEED)
    assert claim.verdict == "illustrated"
    # By homogeneity the chatter of the sampled observer falls as dt^(alpha/(1 - alpha)).
    coarse, fine = (claim.figures[f"error_left_share{rate}"]["0.55"] for rate in ("", "_2000_hz"))
    assert math.log10(coarse / fine) == pytest.approx(0.55 / 0.45, abs=0.3)


def test_the_error_is_gone_in_finite_time() -> None:
    claim = differentiators.finite_time()
    assert claim.verdict == "illustrated"
    gone = list(claim.figures["gone_after_s"].values())
    assert gone == sorted(gone)
    assert math.isinf(differentiators.decay(1.0).end_s)


def test_decay_of_the_linear_observer_in_closed_form() -> None:
    """alpha = 1: poles -10 +- sqrt(50) j, half a turn pi/sqrt(50), in which the size falls by exp(-10 pi/sqrt(50))."""
    result = differentiators.decay(1.0)
    half_turn = math.pi / math.sqrt(50.0)
    spans = result.time_s[result.turns]
    assert spans[2] - spans[1] == pytest.approx(half_turn, rel=2e-3)
    assert result.decades_a_turn == pytest.approx(10.0 * half_turn / math.log(10.0), rel=2e-3)
