"""sokolov2019, Fig. 2: the momentum about the vertical against MuJoCo's, and the thrust bearing on other seeds."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cmg_mj.papers.sokolov2019 import bearing
from cmg_mj.plant.plant import load_plant

SEED = 5_000


def test_momentum_about_the_vertical_is_mujocos() -> None:
    """dH/dt against the yaw torque of MuJoCo's inverse dynamics, at random states of the free rig without yaw."""
    free = load_plant(model="single_gimbal.xml", equilibrium_bias_deg=0.0)
    locked = load_plant(model="single_gimbal.xml", equilibrium_bias_deg=0.0, lock_thrust_bearing=True)
    rng, data = np.random.default_rng(SEED), mujoco.MjData(free.model)
    for _ in range(50):
        q, v, a = rng.uniform(-3.0, 3.0, 3), rng.uniform(-5.0, 5.0, 3) * [1.0, 1.0, 60.0], rng.uniform(-50.0, 50.0, 3)
        data.qpos[:], data.qvel[:], data.qacc[:] = [rng.uniform(-3.0, 3.0), *q], [0.0, *v], [0.0, *a]
        mujoco.mj_inverse(free.model, data)
        torque = bearing.vertical_torque(locked, bearing.Motion(q, v, a))
        assert float(torque) == pytest.approx(float(data.qfrc_inverse[0]), abs=1e-9)


def test_the_yaw_takes_up_the_tilt_like_a_spring() -> None:
    """MuJoCo's tilt acceleration, the yaw rate being what a tilt from rest leaves: m g l - (J_d w_d)^2/(2 I_z)."""
    numbers: dict = bearing.stiffness()
    plant = load_plant(model="single_gimbal.xml", equilibrium_bias_deg=0.0, initial_tilt_deg=0.0)
    data, tilt, M = plant.new_data(), 1e-3, np.zeros((4, 4))

    def momentum() -> float:
        mujoco.mj_forward(plant.model, data)
        mujoco.mj_fullM(plant.model, data, M)
        return float(M[0] @ data.qvel)

    upright = momentum()
    data.qpos[plant.tilt] += tilt
    data.qvel[0] = (upright - momentum()) / M[0, 0]
    mujoco.mj_forward(plant.model, data)
    stiffness = plant.reduced.J1 * float(data.qacc[plant.tilt]) / tilt
    net = numbers["gravity_stiffness_n_m_rad"] - numbers["gyroscopic_stiffness_n_m_rad"]
    assert stiffness == pytest.approx(net, abs=0.01)
    assert stiffness < 0.0  # more than gravity takes


@pytest.fixture(scope="module")
def study() -> bearing.Study:
    return bearing.study(worlds=3, seed=SEED)


def test_claim_of_the_bearing_on_other_seeds(study: bearing.Study) -> None:
    claim = bearing.claim(study)
    assert claim.verdict == "reproduced within stated conditions"
    figures = claim.figures
    assert figures["peak_torque_at_push_n_m"][1] > 2.0 * figures["rms_torque_before_push_n_m"][2]
    assert figures["peak_torque_of_the_pair_n_m"] < 1e-10
    falls = {case: case_figures["fell_fraction"] for case, case_figures in figures["free"].items()}
    assert falls == {"a push of the upright rig": 1.0, "let go 1 deg off, no push": 1.0, "let go upright, no push": 0.0}


def test_a_wrong_closed_form_is_not_reproduced(study: bearing.Study, monkeypatch: pytest.MonkeyPatch) -> None:
    right = bearing.vertical_torque
    monkeypatch.setattr(bearing, "vertical_torque", lambda *args: 1.001 * right(*args))
    assert bearing.claim(study).verdict == "not reproduced"
