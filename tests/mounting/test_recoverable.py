"""The ceiling for any controller, found by trying on the reduced model."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from cmg_mj.laws import TABLE_2_GAINS, carried_over_gains
from cmg_mj.laws.state_feedback import closed_loop_poles
from cmg_mj.plant import load_plant
from cmg_mj.recoverable import ceiling
from cmg_mj.reduced import ReducedModel

RIGS = [
    ReducedModel(0.0618, 0.0, 0.0011, 314.0, 3.4531, 2),
    ReducedModel(17.0, 0.0, 0.0083, 314.0, 147.0, 2),
    ReducedModel(0.3, 0.0, 0.0011, 500.0, 6.0, 1),
]


@pytest.mark.parametrize("model", RIGS)
@pytest.mark.parametrize(("rate", "travel"), [(4.7, math.pi / 2.0), (2.0, 1.0), (20.0, 0.5)])
def test_it_is_the_integral_of_the_best_command(model: ReducedModel, rate: float, travel: float) -> None:
    pole = math.sqrt(model.gravity_torque / model.J1)
    S = quad(lambda t: math.exp(-pole * t) * rate * math.cos(rate * t), 0.0, travel / rate)[0] / pole
    found = ceiling(model, rate, travel)
    assert found.tilt == pytest.approx(model.J_d * model.omega_d / model.J1 * S, rel=1e-9)
    assert found.pole == pytest.approx(pole)


@pytest.mark.parametrize("model", RIGS)
@pytest.mark.parametrize("share", [0.98, 1.02])
@pytest.mark.parametrize("by", ["tilt", "impulse"])
def test_gimbals_that_turn_as_fast_as_they_can_recover_up_to_it(model: ReducedModel, share: float, by: str) -> None:
    """The linearised motion itself: what is left of the growing part says to which side the rig goes."""
    rate, h = 4.7, 1e-4
    top = ceiling(model, rate)
    x1 = share * top.tilt if by == "tilt" else 0.0
    x2 = share * top.impulse / (model.gimbals * model.J1) if by == "impulse" else 0.0
    x3 = 0.0
    while x3 < math.pi / 2.0:
        alpha = (model.gravity_torque * x1 - rate * model.J_d * model.omega_d * math.cos(x3)) / model.J1
        x1, x2, x3 = x1 + h * x2 + 0.5 * h * h * alpha, x2 + h * alpha, x3 + h * rate
    assert (x1 + x2 / top.pole > 0.0) == (share > 1.0)


def test_carried_over_gains_are_table_2_on_the_papers_rig() -> None:
    gains = carried_over_gains(load_plant().reduced)
    np.testing.assert_allclose(gains, TABLE_2_GAINS, rtol=1e-3)


@pytest.mark.parametrize("model", RIGS[1:])
def test_carried_over_gains_make_the_papers_loop_at_the_robots_pace(model: ReducedModel) -> None:
    papers = load_plant().reduced
    tau = math.sqrt(papers.gravity_torque / papers.J1 / (model.gravity_torque / model.J1))
    poles = np.sort_complex(closed_loop_poles(model, carried_over_gains(model)) * tau)
    np.testing.assert_allclose(poles, np.sort_complex(closed_loop_poles(papers, TABLE_2_GAINS)), rtol=2e-3)
