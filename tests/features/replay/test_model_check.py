"""A model that the log cannot be of."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from cmg_mj import load_scenario, prepare
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.features.replay.log import Log
from cmg_mj.features.replay.log_replay import misfit_of, replay_log
from cmg_mj.features.replay.reference import MISFIT, model_misfit, model_remark
from cmg_mj.features.replay.report import log_figures, remarks

HANGING = ReducedModel(0.06, 0.0, 0.0, 1.0, -3.4)
N, DT = 3000, 0.005


def log_of(tilt: np.ndarray) -> Log:
    zero = np.zeros(len(tilt))
    columns = {"time_s": DT * np.arange(len(tilt)), "y1_rad": tilt, "y2_rad": zero, "u_rad_s": zero}
    columns |= {"acceleration_rad_s2": zero + math.nan, "reference_rad_s": zero + math.nan}
    return Log("swing", DT, columns, [slice(0, len(tilt))], frozenset())


def swing(sigma: float = 0.0) -> Log:
    """A pendulum that hangs, released at 40 deg, by small steps of the midpoint rule; with noise."""
    y, w, tilts, step = math.radians(40.0), 0.0, [], DT / 10.0
    for k in range(10 * N):
        if k % 10 == 0:
            tilts.append(y)
        middle = w - step / 2.0 * 3.4 / 0.06 * math.sin(y)
        y, w = y + step * middle, middle - step / 2.0 * 3.4 / 0.06 * math.sin(y + step * middle)
    return log_of(np.array(tilts) + sigma * np.random.default_rng(0).standard_normal(N))


def test_of_the_pendulum_itself_nothing_is_missing() -> None:
    right = model_misfit(swing(), HANGING)
    assert right is not None
    assert right < 0.01
    assert model_remark(right) is None


@pytest.mark.parametrize(("torque", "misfit"), [(3.4, 2.0), (0.0, 1.0), (-6.8, 1.0), (-1.7, 0.5)])
def test_of_another_it_is_what_the_sums_say(torque: float, misfit: float) -> None:
    """Predicted is torque / -3.4 times the right one, so |torque / -3.4 - 1| of it is missed, by that of noise."""
    model = dataclasses.replace(HANGING, gravity_torque=torque)
    assert model_misfit(swing(), model) == pytest.approx(misfit / norm_of_noise(torque / 0.06), rel=0.02)


def norm_of_noise(stiffness: float) -> float:
    """Of w = (1 - (t/h)^2)^4 by integrals over t/h: |stiffness w - w''| by |w''|, where <w, w''> = -<w', w'>."""
    s, h = np.linspace(-1.0, 1.0, 20_001), 26 * DT
    w, first, second = (1 - s**2) ** 4, -8 * s * (1 - s**2) ** 3, 8 * (1 - s**2) ** 2 * (7 * s**2 - 1)
    i0, i1, i2 = (float(np.sum(values**2)) for values in (w, first, second))
    return math.sqrt(1.0 + (2.0 * stiffness * h**2 * i1 + stiffness**2 * h**4 * i0) / i2)


@pytest.mark.parametrize("torque", [-3.4, 3.4, 12.0])
def test_of_noise_alone_it_is_one_whatever_the_model(torque: float) -> None:
    noise = 1e-3 * np.random.default_rng(1).standard_normal(60_000)
    model = dataclasses.replace(HANGING, gravity_torque=torque)
    assert model_misfit(log_of(noise), model) == pytest.approx(1.0, abs=0.05)


def test_an_offset_of_the_tilt_changes_little() -> None:
    """As of a zero that is 1 deg off."""
    log = swing(1e-3)
    shifted = log_of(log["y1_rad"] + math.radians(1.0))
    assert model_misfit(shifted, HANGING) == pytest.approx(model_misfit(log, HANGING), abs=0.05)


def test_gimbals_that_are_not_in_the_log_leave_it_open() -> None:
    assert misfit_of(swing(), dataclasses.replace(HANGING, J_d=0.1)) is None
    assert misfit_of(swing(), None) is None
    assert misfit_of(swing(), HANGING) is not None


def test_it_is_said_in_a_replay() -> None:
    wrong = dataclasses.replace(HANGING, gravity_torque=3.4)
    replayed = replay_log(swing(), ["homogeneous"], model=wrong)
    assert log_figures(replayed)["model_misfit"] == pytest.approx(1.86, abs=0.01)
    assert any(line.startswith("Can the model be that of this log?") for line in remarks(replayed))
    right = remarks(replay_log(swing(), ["homogeneous"], model=HANGING))
    assert not any(line.startswith("Can the model") for line in right)


@pytest.mark.slow
@pytest.mark.parametrize("settings", [[], ["controller.feedback='fog'", "duration_s=6"]])
def test_right_models_are_not_doubted(settings: list[str]) -> None:
    """Runs on other seeds than those of docs/studies/model_misfit.py."""
    experiment = prepare(load_scenario("push_recovery", [*settings, "seed=77"]))
    trajectory = experiment.run_many(12).trajectory
    assert trajectory is not None
    right = experiment.plant.reduced
    for world in range(12):
        columns = {n: trajectory.columns[n][:, world] for n in ("y1_rad", "y2_rad", "u_rad_s")}
        log = dataclasses.replace(log_of(columns["y1_rad"]), columns=columns)
        misfit = model_misfit(log, right)
        assert misfit is not None
        assert misfit < 1.3 < MISFIT
