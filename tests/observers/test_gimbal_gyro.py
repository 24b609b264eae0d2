"""docs/studies/gimbal_gyro.py: plain MuJoCo's gimbals give way to the rate; the filter's step, update, floor, worth."""

from __future__ import annotations

import importlib
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.stats import truncnorm

from tests.observers.reference import DT, NOISE, PAPER

ROOT = Path(__file__).resolve().parents[2]
SPIN = PAPER.J_d * PAPER.omega_d


@pytest.fixture
def study(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(ROOT / "docs/studies")
    return importlib.import_module("gimbal_gyro")


def six_bodies(x1: float, x2: float, x3: float, turn: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Plain MuJoCo in scissored motion."""
    model = mujoco.MjModel.from_xml_path(str(ROOT / "models/scissored_pair.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[[1, 2, 4]] += [x1, x3, -x3]
    data.act[:] += [x3, -x3]
    data.qvel[[1, 2, 4]] = [x2, turn, -turn]
    return model, data


def test_the_filter_steps_as_the_plant_does(study: Any) -> None:
    """At the control period, but for the flywheels' speed, which the reduced model holds."""
    of, rng = study.GimbalGyro(DT, PAPER, NOISE), np.random.default_rng(0)
    for _ in range(20):
        start = rng.uniform(-1.0, 1.0, 4) * [0.1, 0.5, 0.5, 1.0]
        u = rng.uniform(-2.0, 2.0)
        model, data = six_bodies(*start)
        data.ctrl[0], data.ctrl[2] = u, -u
        mujoco.mj_step(model, data)
        reached = [data.qpos[1] + math.pi / 4.0, data.qvel[1], data.qpos[2] - math.pi / 2.0, data.qvel[2]]
        moved = of.moved(np.array([[*start, *[0.0] * 5]]), start[2], u)[0, :4]
        assert (np.abs(moved - reached) < [2e-6, 2e-4, 2e-6, 2e-4]).all()


def test_mean_and_variance_of_what_lies_in_a_count(study: Any) -> None:
    limits = [(-0.5, 0.5), (-3.0, 0.1), (0.2, 9.0), (2.0, 2.5), (-7.0, -5.0)]
    for low, high in limits:
        expected = truncnorm(low, high).stats("mv")
        np.testing.assert_allclose(study.truncated(np.array(low), np.array(high)), expected, rtol=1e-6)


def test_without_the_encoder_the_floor_is_that_of_one_unstable_pole(study: Any) -> None:
    """Sampled often, its variance is 2 l^3 R, with R the density of the noise of y1 and the acceleration together."""
    of = study.GimbalGyro(DT, PAPER, NOISE, count=1e6)
    inertia = PAPER.J1 + SPIN**2 / of.stiffness  # the servos give way
    pole2 = PAPER.gravity_torque / inertia
    both = NOISE.correlation * NOISE.tilt * NOISE.acceleration
    R = np.array([[NOISE.tilt**2, both], [both, NOISE.acceleration**2]])
    seen = np.array([1.0, pole2])
    density = DT / (seen @ np.linalg.solve(R, seen))
    assert study.floor_all(of) == pytest.approx(math.sqrt(2.0 * pole2**1.5 * density), rel=0.05)
    assert study.floor_all(replace(of, count=1e-3)) < 0.9 * study.floor_all(of)


@pytest.mark.slow
def test_the_filter_is_below_the_linear_floor_and_friction_ends_that(study: Any) -> None:
    def errors(observer: str, *settings: str) -> np.ndarray:
        return study.experiment(observer, *settings).run_many(20, keep_trajectory=False).values(study.ERRORS[0])

    floor, plain = study.floor_all(study.GimbalGyro(DT, PAPER, NOISE)), errors("gyro_free")
    ours = errors(study.OURS)
    assert floor == pytest.approx(0.0115, rel=0.01)
    assert ours.mean() + 3.0 * ours.std() / math.sqrt(20) < floor < plain.mean()
    rough = "plant.gimbal_friction_n_m=0.1"
    told = errors(study.OURS, rough, "observer.drag=0.1")
    assert told.mean() == pytest.approx(plain.mean(), rel=0.1)
    assert np.isnan(errors(study.OURS, rough)).any()
