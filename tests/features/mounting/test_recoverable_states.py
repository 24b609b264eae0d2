"""The ceiling for any controller, found by trying on the reduced model."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.integrate import quad

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.features.mounting import mount
from cmg_mj.features.mounting.limits import PUSH_S, push_margin
from cmg_mj.features.mounting.write import write_scenario
from cmg_mj.laws import TABLE_2_GAINS, scaled_gains
from cmg_mj.laws.state_feedback import closed_loop_poles
from cmg_mj.linear.ceiling import ceiling
from cmg_mj.plant.plant import load_plant
from cmg_mj.runs.experiment import Experiment

FAST = """
<mujoco>
  <option timestep="0.002" integrator="RK4"/>
  <worldbody>
    <body name="trunk"><joint name="hip" axis="0 1 0"/>
      <geom type="box" size="0.02 0.02 0.02" pos="0 0 0.05" mass="0.1"/></body>
  </worldbody>
</mujoco>
"""
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
    result = ceiling(model, rate, travel)
    assert result.tilt == pytest.approx(model.J_d * model.omega_d / model.J1 * S, rel=1e-9)
    assert result.pole == pytest.approx(pole)


@pytest.mark.parametrize("model", RIGS)
@pytest.mark.parametrize("share", [0.98, 1.02])
@pytest.mark.parametrize("cause", ["tilt", "blow", "push"])
def test_gimbals_that_turn_as_fast_as_they_can_recover_up_to_it(model: ReducedModel, share: float, cause: str) -> None:
    """The linearised motion itself: what is left of the growing part says to which side the rig goes.

    The push is one of 0.1 s, from whose first moment on the gimbals turn.
    """
    rate, h = 4.7, 1e-4
    top = ceiling(model, rate)
    inertia = model.gimbals * model.J1
    x1 = share * top.tilt if cause == "tilt" else 0.0
    x2 = share * top.impulse / inertia if cause == "blow" else 0.0
    push_alpha = share * top.push_impulse(PUSH_S) / PUSH_S / inertia if cause == "push" else 0.0
    x3 = 0.0
    for step in range(math.ceil(max(math.pi / 2.0 / rate, PUSH_S) / h)):
        gimbal_rate = rate if x3 < math.pi / 2.0 else 0.0
        alpha = (model.gravity_torque * x1 - gimbal_rate * model.J_d * model.omega_d * math.cos(x3)) / model.J1
        alpha += push_alpha if step * h < PUSH_S else 0.0
        x1, x2, x3 = x1 + h * x2 + 0.5 * h * h * alpha, x2 + h * alpha, x3 + h * gimbal_rate
    assert (x1 + x2 / top.pole > 0.0) == (share > 1.0)


def test_a_push_is_less_than_a_blow_of_its_impulse() -> None:
    """A short one is a blow; of a longer one gimbals take off more while it lasts."""
    top = ceiling(RIGS[0], 4.7)
    assert top.push_impulse(0.0) == top.impulse == pytest.approx(top.push_impulse(1e-9))
    pushes = [top.push_impulse(duration) for duration in (0.0, 0.05, 0.1, 0.5)]
    assert pushes == sorted(set(pushes))
    weight = quad(lambda t: math.exp(-top.pole * t), 0.0, PUSH_S)[0] / PUSH_S
    assert top.push_impulse(PUSH_S) * weight == pytest.approx(top.impulse)


@pytest.fixture(scope="module")
def fast(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    """A light rod that falls with 8 1/s: a push of 0.1 s is no blow to it."""
    model = mount(mujoco.MjSpec.from_string(FAST), "trunk").save(tmp_path_factory.mktemp("fast") / "rig.xml")
    return write_scenario(model, model, "homogeneous")


@pytest.mark.daily_cases("observer")
@pytest.mark.parametrize(
    "feedback",
    [{}, {"controller.feedback": "truth"}, {"observer": {"kind": "gyro_free"}}],
    ids=["observer", "truth", "gyro"],
)
def test_no_controller_bears_more(fast: Experiment, feedback: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does the one that is fed the true rate; it bears more than any blow that can be recovered from."""
    monkeypatch.setattr("cmg_mj.features.mounting.limits.WORLDS", 4)
    monkeypatch.setattr("cmg_mj.features.mounting.limits.LEVELS", 16)
    monkeypatch.setattr("cmg_mj.features.mounting.limits.BEFORE_S", 0.3)
    experiment = fast.with_settings(feedback)
    top = ceiling(experiment.plant.reduced, experiment.law.rate_limit)
    assert top.pole == pytest.approx(7.85, rel=0.01)
    impulse = push_margin(experiment.design).median_impulse
    assert 0.4 * top.push_impulse(PUSH_S) < impulse < top.push_impulse(PUSH_S)
    if feedback:
        assert impulse > top.impulse


def test_carried_over_gains_are_table_2_on_the_papers_rig() -> None:
    gains = scaled_gains(load_plant().reduced)
    np.testing.assert_allclose(gains, TABLE_2_GAINS, rtol=1e-3)


@pytest.mark.parametrize("model", RIGS[1:])
def test_carried_over_gains_make_the_papers_loop_at_the_robots_pace(model: ReducedModel) -> None:
    papers = load_plant().reduced
    tau = math.sqrt(papers.gravity_torque / papers.J1 / (model.gravity_torque / model.J1))
    poles = np.sort_complex(closed_loop_poles(model, scaled_gains(model)) * tau)
    np.testing.assert_allclose(poles, np.sort_complex(closed_loop_poles(papers, TABLE_2_GAINS)), rtol=2e-3)
