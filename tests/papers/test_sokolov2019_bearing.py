"""sokolov2019, Fig. 2: the momentum about the vertical against MuJoCo's, and the thrust bearing on other seeds."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cmg_mj.papers.sokolov2019 import bearing
from cmg_mj.papers.sokolov2019.bearing import Motion, vertical_momentum, vertical_torque
from cmg_mj.plant.plant import load_plant

SEED = 5_000


def test_momentum_about_the_vertical_is_mujocos() -> None:
    """H against the yaw row of MuJoCo's mass matrix, at random states of the free rig without yaw."""
    free = load_plant(model="single_gimbal.xml", equilibrium_bias_deg=0.0)
    locked = load_plant(model="single_gimbal.xml", equilibrium_bias_deg=0.0, lock_thrust_bearing=True)
    rng, data = np.random.default_rng(SEED), mujoco.MjData(free.model)
    M = np.zeros((4, 4))
    for _ in range(50):
        q, v = rng.uniform(-3.0, 3.0, 3), rng.uniform(-5.0, 5.0, 3) * [1.0, 1.0, 60.0]
        data.qpos[:] = [rng.uniform(-3.0, 3.0), *q]
        mujoco.mj_forward(free.model, data)
        mujoco.mj_fullM(free.model, data, M)
        H = vertical_momentum(locked, Motion(q, v, np.zeros(3)))
        assert pytest.approx(float(M[0, 1:] @ v), abs=1e-12) == H


def test_torque_is_the_momentums_derivative() -> None:
    """dH/dt by its formula against a difference quotient of H."""
    plant = load_plant(model="single_gimbal.xml", lock_thrust_bearing=True)
    rng, h = np.random.default_rng(SEED), 1e-5
    for _ in range(20):
        q, a = rng.uniform(-3.0, 3.0, 3), rng.uniform(-50.0, 50.0, 3)
        v = rng.uniform([-5.0, -5.0, 200.0], [5.0, 5.0, 400.0])

        def H(t: float, q: np.ndarray = q, v: np.ndarray = v, a: np.ndarray = a) -> float:
            return float(vertical_momentum(plant, Motion(q + t * v + t * t * a / 2.0, v + t * a, a)))

        slope = (H(h) - H(-h)) / (2.0 * h)
        assert float(vertical_torque(plant, Motion(q, v, a))) == pytest.approx(slope, abs=1e-6)


def test_the_yaw_takes_up_the_tilt_like_a_spring() -> None:
    """MuJoCo's tilt acceleration, the yaw rate being what a tilt from rest leaves: m g l - (J_d w_d)^2/(2 I_z)."""
    numbers = bearing.stiffness()
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
    assert stiffness == pytest.approx(numbers.gravity - numbers.gyroscopic, abs=0.01)
    assert stiffness < 0.0  # more than gravity takes


@pytest.fixture(scope="module")
def study() -> bearing.Study:
    return bearing.study(lambda share: None, worlds=3, seed=SEED)


def test_claim_of_the_bearing_on_other_seeds(study: bearing.Study) -> None:
    claim = bearing.claim(study)
    assert claim.verdict == "reproduced within stated conditions"
    figures = claim.figures
    assert figures["peak_torque_at_push_n_m"][1] > 2.0 * figures["rms_torque_before_push_n_m"][2]
    assert figures["peak_torque_of_the_pair_n_m"] < 1e-10
    falls = {case: case_figures["fell_fraction"] for case, case_figures in figures["free"].items()}
    assert falls == {"a push of the upright rig": 1.0, "let go 1 deg off, no push": 1.0, "let go upright, no push": 0.0}


def test_a_wrong_closed_form_is_not_reproduced(study: bearing.Study, monkeypatch: pytest.MonkeyPatch) -> None:
    right = vertical_torque
    monkeypatch.setattr(bearing, "vertical_torque", lambda *args: 1.001 * right(*args))
    assert bearing.claim(study).verdict == "not reproduced"
