"""Section II of aranovskiy2020: servos in velocity mode; Section I: two pairs at right angles."""

from __future__ import annotations

import dataclasses
from typing import Any

import mujoco
import numpy as np
import pytest

from cmg_mj.papers.aranovskiy2020 import hypotheses, two_axes
from cmg_mj.papers.aranovskiy2020.paper import TABLE_1
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.plant.plant import load_plant
from cmg_mj.results.result import Result

SEED = 910_000


@pytest.mark.parametrize(("command", "expected"), [(0.05, 0.0), (-0.05, 0.0), (0.5, 0.4), (-0.5, -0.4)])
def test_a_gimbal_with_a_deadband_of_a_tenth(command: float, expected: float) -> None:
    """Upright without a push, after a few lags: it stands, or turns slower by the deadband."""
    plant = load_plant(timestep_s=0.001, initial_tilt_deg=0.0, equilibrium_bias_deg=0.0)
    hypotheses.in_velocity_mode(plant, 0.1)
    data = plant.new_data()
    for module in plant.axis.modules:
        data.ctrl[module.servo] = module.direction * command
    mujoco.mj_step(plant.model, data, 20)
    for module in plant.axis.modules:
        assert module.direction * data.qvel[module.gimbal] == pytest.approx(expected, abs=0.01)


@pytest.fixture(scope="module")
def servos() -> hypotheses.Servos:
    return hypotheses.run_servos(2, SEED, 4.0)


def test_servos_of_a_small_deadband_are_not_noticed(servos: hypotheses.Servos) -> None:
    claim = hypotheses.servo_claim(servos)
    assert claim.verdict == "reproduced within stated conditions"
    tilts = [ratio.mean for ratio in claim.figures["tilt_rms_by_none"]]
    assert tilts[0] == pytest.approx(1.0)
    assert tilts[-2] > tilts[3] > 1.0  # a large one is
    stiff, soft = claim.figures["tracking_error_share"][0].mean, claim.figures["tracking_error_share_soft"].mean
    assert soft > 2.0 * stiff


def test_a_servo_that_is_noticed_is_not_reproduced(servos: hypotheses.Servos) -> None:
    """In the tilt alone, in the estimate alone, or in what the gimbal does."""
    small = servos.velocity[hypotheses.RESOLUTION]
    for key in ("tilt_rms_deg", "velocity_rms_error_rad_s"):
        figures: list[dict[str, Any]] = small.summaries
        summaries = [summary | {key: 1.2 * summary[key]} for summary in figures]
        swapped = dict(servos.velocity) | {hypotheses.RESOLUTION: dataclasses.replace(small, summaries=summaries)}
        assert hypotheses.servo_claim(servos._replace(velocity=swapped)).verdict == "not reproduced"
    loose = dataclasses.replace(small, trajectory=servos.velocity[hypotheses.DEADBANDS[-1]].trajectory)
    swapped = dict(servos.velocity) | {hypotheses.RESOLUTION: loose}
    assert hypotheses.servo_claim(servos._replace(velocity=swapped)).verdict == "not reproduced"


def test_tracking_is_the_rate_less_the_command(servos: hypotheses.Servos) -> None:
    """A recording whose gimbal turns at 0.9 of the command is a tenth off."""
    run = trajectory_of(servos.soft)
    time = run["time_s"]
    command = np.tile(np.sin(time)[:, None], (1, 2))
    angle = 0.9 * np.vstack([np.zeros((1, 2)), np.cumsum(command, axis=0)[:-1]]) * (time[1] - time[0])
    columns = dict(run.columns) | {"u_rad_s": command, "x3_rad": angle}
    result = Result(servos.soft.outcomes, servos.soft.summaries, dataclasses.replace(run, columns=columns))
    error = hypotheses.measure_tracking(result)
    assert error is not None
    assert error.mean == pytest.approx(0.1, rel=1e-6)


# --- two axes -------------------------------------------------------------------------------------------------


def test_the_body_of_two_pairs_has_the_papers_numbers() -> None:
    """Both axes alike: four halves and their wheels and gimbals above the joint, worked out from Table 1."""
    model = two_axes.two_pairs()
    inertia = 0.5 * (13e-3 + 10e-3) * 2.0 + TABLE_1["m"] * (two_axes.HEIGHT_M**2 + 0.095**2) * 2.0
    for axis in range(2):
        reduced = two_axes.reduced(model, axis)
        assert reduced.gravity_torque == pytest.approx(2.0 * TABLE_1["m"] * 9.81 * two_axes.HEIGHT_M, rel=1e-6)
        assert pytest.approx(inertia, rel=0.05) == reduced.J1  # gimbals and wheels besides
    pitch, roll = (two_axes.reduced(model, axis) for axis in range(2))
    assert pytest.approx(roll.J1, rel=1e-12) == pitch.J1


def test_a_command_tilts_its_own_axis_as_the_reduced_model_says() -> None:
    """Upright, gimbals turned at 1 rad/s by hand: J_d omega_d/J1 on its own axis, nothing on the other."""
    model = two_axes.two_pairs()
    expected = TABLE_1["J_d"] * TABLE_1["omega_d"] / two_axes.reduced(model, 0).J1
    for axis in range(2):
        places, data = two_axes.addresses(model, axis), two_axes.at_rest(model)
        for sign, gimbal in zip(places.signs, places.gimbals, strict=True):
            data.qvel[gimbal] = sign
        mujoco.mj_forward(model, data)
        # The other pair's gimbals are free for a moment.
        assert data.qacc[places.tilt] == pytest.approx(expected, rel=0.02)
        other_tilt = two_axes.addresses(model, 1 - axis).tilt
        assert abs(data.qacc[other_tilt]) < 1e-6 * expected


def test_the_axes_are_separate_and_a_coupling_would_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    coupling = two_axes.coupling(1.0)
    assert two_axes.one_axis_at_a_time((1.0,)).verdict == "reproduced within stated conditions"
    assert 0.0 < coupling.share < 0.01
    right = two_axes.addresses

    def one_gimbal(model: mujoco.MjModel, axis: int) -> two_axes.Addresses:
        """A pair whose second gimbal stands still: its one wheel's momentum leans on the other axis as well."""
        return right(model, axis)._replace(signs=[right(model, axis).signs[0], 0.0])

    monkeypatch.setattr(two_axes, "addresses", one_gimbal)
    broken_coupling = two_axes.coupling(1.0)
    assert broken_coupling.share > 10.0 * coupling.share
