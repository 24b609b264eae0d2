"""(9) of aranovskiy2020, its lag and noise, and (11), the vicinity that its error converges to."""

from __future__ import annotations

import math

import pytest

from cmg_mj.papers.aranovskiy2020 import lag, vicinity
from cmg_mj.papers.aranovskiy2020.rig import DT

SEED = 910_000


@pytest.mark.parametrize("tau", [0.01, 0.02, 0.05])
def test_lag_and_noise_of_the_linear_differentiator(tau: float) -> None:
    found, expected = lag.trade(tau, SEED), lag.foreseen(tau)
    assert found.lag_s == pytest.approx(2.0 * tau, rel=1e-3)
    assert found.noise_gain_1_s == pytest.approx(expected.noise_gain_1_s, rel=0.04)


def test_the_trade_is_reproduced() -> None:
    assert lag.lag_claim(SEED).verdict == "reproduced"


def test_noise_of_a_long_time_constant() -> None:
    assert lag.foreseen(1.0).noise_gain_1_s == pytest.approx(math.sqrt(DT / 4.0), rel=0.01)


def test_vicinity_of_the_homogeneous_differentiator() -> None:
    claim = vicinity.vicinity_claim(SEED)
    assert claim.verdict == "reproduced within stated conditions"
    # By homogeneity the chatter of the sampled observer falls as dt^(alpha/(1 - alpha)).
    coarse, fine = (claim.figures[f"error_left_share{rate}"]["0.55"] for rate in ("", "_2000_hz"))
    assert math.log10(coarse / fine) == pytest.approx(0.55 / 0.45, abs=0.3)
