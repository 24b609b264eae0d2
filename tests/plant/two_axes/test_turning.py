"""The coupling by a turn about the vertical on the full model, and the gimbal rates that cancel it.

The torques that the wheels' momentum asks of the joints are those of the rig whose wheels turn less those of the same
rig whose wheels stand: MuJoCo's inverse dynamics at given rates, without accelerations.
"""

from __future__ import annotations

import copy
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cmg_mj.inputs.files import folder
from cmg_mj.plant.axis import Axis
from cmg_mj.plant.plant import Plant, load_plant

H = 1.1e-3 * 314.0
"""A wheel's momentum [N m s]."""


@pytest.fixture(scope="module", params=["two_axes.xml", "two_axes_free_base.xml"])
def plant(request: pytest.FixtureRequest) -> Plant:
    return load_plant(model=request.param, equilibrium_bias_deg=0.0)


def set_gimbals(data: mujoco.MjData, axis: Axis, angle: float, rate: float) -> None:
    """Turn the gimbals of an axis."""
    for module in axis.modules:
        data.qpos[module.gimbal] = module.gimbal_zero + module.direction * angle
        data.qvel[module.gimbal_dof] = module.direction * rate


def gimbal_torques(
    plant: Plant, rates: dict[str, float], angles: list[float], u: list[float], off: float = 0.0
) -> np.ndarray:
    """The wheels' torques on yaw, roll and pitch [N m].

    Args:
        plant: The rig, at its keyframe.
        rates: Of yaw, roll and pitch [rad/s].
        angles: x3 of each axis [rad].
        u: Gimbal rate of each axis [rad/s].
        off: How far the first gimbal is ahead of where it should be [rad].
    """
    model = copy.copy(plant.model)
    torques = []
    for share in (1.0, 0.0):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, plant.key)
        for axis, angle, rate in zip(plant.axes, angles, u, strict=True):
            set_gimbals(data, axis, angle, rate)
            for module in axis.modules:
                data.qvel[module.flywheel_dof] *= share
        first = plant.axis.modules[0]
        data.qpos[first.gimbal] += first.direction * off
        for name, rate in rates.items():
            data.joint(name).qvel[0] = rate
        mujoco.mj_inverse(model, data)
        torques.append([data.joint(name).qfrc_inverse[0] for name in ("yaw", "roll", "pitch")])
    return np.array(torques[0]) - torques[1]


def compensation(plant: Plant, w: float, angles: list[float]) -> list[float]:
    """u_i = w sum_j c_ij sin(x3_j)/cos(x3_i)."""
    return [
        w * float(np.dot(row, np.sin(angles))) / math.cos(angle)
        for row, angle in zip(plant.turning.flywheels, angles, strict=True)
    ]


ANGLES = [[0.7, 0.2], [-0.4, 1.0], [0.0, -0.9], [0.5, 0.5]]


@pytest.mark.parametrize("angles", ANGLES)
@pytest.mark.parametrize("w", [1.0, -3.0])
def test_the_swept_momentum_tilts_the_other_axis(plant: Plant, w: float, angles: list[float]) -> None:
    """Roll's momentum, swept round, tilts pitch with 2 H w sin(x3_R), pitch's roll with the opposite sign."""
    _, roll, pitch = gimbal_torques(plant, {"yaw": w}, angles, [0.0, 0.0])
    x3_roll, x3_pitch = angles
    assert pitch == pytest.approx(-2.0 * H * w * math.sin(x3_roll), abs=1e-12)  # asked to hold it: the opposite
    assert roll == pytest.approx(2.0 * H * w * math.sin(x3_pitch), abs=1e-12)


@pytest.mark.parametrize("angles", ANGLES)
@pytest.mark.parametrize("w", [1.0, -3.0])
def test_gimbals_turned_against_it_leave_nothing(plant: Plant, w: float, angles: list[float]) -> None:
    _, roll, pitch = gimbal_torques(plant, {"yaw": w}, angles, compensation(plant, w, angles))
    assert max(abs(roll), abs(pitch)) < 1e-12


def test_signs_and_sizes_follow_the_wheels() -> None:
    """c_ij from the wheels' axes and speeds: none of them is assumed."""
    plant = load_plant(model="two_axes.xml")
    np.testing.assert_allclose(plant.turning.flywheels, [[0.0, 1.0], [-1.0, 0.0]], atol=1e-12)
    half = load_plant(model="two_axes.xml", flywheel_speed_rad_s=157.0)
    np.testing.assert_allclose(half.turning.flywheels, plant.turning.flywheels, atol=1e-12)
    assert load_plant(model="two_axes.xml", locked_axes=["pitch"]).turning.flywheels == [[0.0]]


def rig_with(tmp_path: Path, *changes: tuple[str, str]) -> Plant:
    """The rig with other text in two_axes.xml or the files that it includes."""
    for path in folder("models").glob("*.xml"):
        text = path.read_text()
        for old, new in changes:
            text = text.replace(old, new)
        (tmp_path / path.name).write_text(text)
    return load_plant(model=str(tmp_path / "two_axes.xml"), equilibrium_bias_deg=0.0)


WHEELS = "0 0 0 0 314 0 -314 0 314 0 -314", "0 0 314 0 -314 0 314 0 -314"
OTHER_WHEELS = {
    "pitch's wheels the other way round": ("0 0 0 0 314 0 -314 0 -314 0 314", "0 0 314 0 -314 0 -314 0 314"),
    "pitch's wheels half as fast": ("0 0 0 0 314 0 -314 0 157 0 -157", "0 0 314 0 -314 0 157 0 -157"),
    "a wheel of roll's slow": ("0 0 0 0 282.6 0 -314 0 314 0 -314", "0 0 282.6 0 -314 0 314 0 -314"),
}


@pytest.mark.parametrize("wheels", OTHER_WHEELS.values(), ids=OTHER_WHEELS)
def test_other_wheels_have_other_signs_and_sizes(wheels: tuple[str, str], tmp_path: Path) -> None:
    """And the rates they give cancel what these wheels ask for."""
    plant = rig_with(tmp_path, *zip(WHEELS, wheels, strict=True))
    w, angles = 1.5, [0.6, -0.4]
    _, roll, pitch = gimbal_torques(plant, {"yaw": w}, angles, compensation(plant, w, angles))
    assert max(abs(roll), abs(pitch)) < 1e-12
    u = [1.0, 1.0]  # a positive rate pushes about its axis, whichever way the wheels turn
    assert np.all(gimbal_torques(plant, {}, [0.0, 0.0], u)[1:] < -0.1)


# --- what else couples ------------------------------------------------------------------------------------------


def test_alike_wheels_couple_the_axes_through_the_vertical_alone() -> None:
    """The tilt of one axis sweeps the other's momentum round the vertical: the yaw servo holds 2 H sin(x3) x2."""
    plant = load_plant(model="two_axes.xml", equilibrium_bias_deg=0.0)
    yaw, roll, pitch = gimbal_torques(plant, {"pitch": 0.5}, [0.6, 0.0], [0.0, 0.0])
    assert yaw == pytest.approx(2.0 * H * math.sin(0.6) * 0.5, rel=1e-9)
    assert max(abs(roll), abs(pitch)) < 1e-12


def test_a_slow_wheel_couples_the_axes_directly(tmp_path: Path) -> None:
    """A tenth of a wheel's momentum is left along the vertical, upright or not.

    A pitch rate turns it against roll, a roll rate against pitch: 0.1 H x2, which is a tilt acceleration of 0.10/s
    times the other's rate, beside poles of 6.4/s. Turning gimbals change it, which yaw feels.
    """
    plant = rig_with(tmp_path, *zip(WHEELS, OTHER_WHEELS["a wheel of roll's slow"], strict=True))
    left = 0.1 * H
    _, roll, _ = gimbal_torques(plant, {"pitch": 0.5}, [0.0, 0.0], [0.0, 0.0])
    assert abs(roll) == pytest.approx(left * 0.5, rel=1e-9)
    _, _, pitch = gimbal_torques(plant, {"roll": 0.5}, [0.0, 0.0], [0.0, 0.0])
    assert pitch == pytest.approx(-roll, rel=1e-9)
    yaw, _, _ = gimbal_torques(plant, {}, [0.6, 0.0], [2.0, 0.0])
    assert abs(yaw) == pytest.approx(left * math.sin(0.6) * 2.0, rel=1e-9)
    rates = left / (2.0 * plant.axes[1].reduced.J1)
    assert rates == pytest.approx(0.101, abs=1e-3)
    assert plant.axes[0].reduced.J_d * plant.axes[0].reduced.omega_d == pytest.approx(0.95 * H, rel=1e-9)
    assert any("do not cancel" in hint for hint in plant.hints)


def test_a_gimbal_that_is_off_pushes_yaw_and_is_made_up_for_on_the_mean() -> None:
    """5 degrees ahead of its partner: H sin(5 deg) lies along roll's line, and turns with the gimbals."""
    plant = load_plant(model="two_axes.xml", equilibrium_bias_deg=0.0)
    off = math.radians(5.0)
    zeros, gimbal_rates = [0.0, 0.0], [1.0, 0.0]
    _, _, pitch = gimbal_torques(plant, {"yaw": 1.0}, zeros, zeros, off)
    assert pitch == pytest.approx(-H * math.sin(off), rel=1e-9)
    yaw, roll, _ = gimbal_torques(plant, {}, zeros, gimbal_rates, off)
    assert abs(yaw) == pytest.approx(H * math.sin(off), rel=1e-9)
    assert abs(roll) == pytest.approx(H * (1.0 + math.cos(off)), rel=1e-9)
    mean = compensation(plant, 1.0, [off / 2.0, 0.0])
    _, _, left = gimbal_torques(plant, {"yaw": 1.0}, zeros, mean, off)
    assert abs(left) < 1e-3 * abs(pitch)


def tilt_torques(plant: Plant, rates: dict[str, float]) -> np.ndarray:
    """Torques on roll and pitch without accelerations, the wheels standing [N m]."""
    data = mujoco.MjData(plant.model)
    mujoco.mj_resetDataKeyframe(plant.model, data, plant.key)
    data.qvel[:] = 0.0
    for name, rate in rates.items():
        data.joint(name).qvel[0] = rate
    mujoco.mj_inverse(plant.model, data)
    return np.array([data.joint(name).qfrc_inverse[0] for name in ("roll", "pitch")])


def test_a_tilt_that_is_swept_round_tilts_the_other_axis(plant: Plant) -> None:
    """By (I_roll + I_pitch - I_yaw) w x2; gimbals turned at w d x2 push as much the other way."""
    w, rate = 1.5, 0.2
    for i, j, axis in ((0, 1, "pitch"), (1, 0, "roll")):
        both, alone, turn = ({"yaw": w, axis: rate}, {axis: rate}, {"yaw": w})
        coupling = (tilt_torques(plant, both) - tilt_torques(plant, alone) - tilt_torques(plant, turn))[i]
        u = [0.0, 0.0]
        u[i] = w * plant.turning.inertia[i][j] * rate
        push = gimbal_torques(plant, {}, [0.0, 0.0], u)[1 + i]
        assert abs(coupling) > 0.1
        assert push == pytest.approx(-coupling, rel=1e-3)


def test_what_accelerometers_show_of_a_tilt_that_is_swept_round(plant: Plant) -> None:
    w, rate = 1.5, 0.2
    for i, j, axis_name in ((0, 1, "pitch"), (1, 0, "roll")):
        data = plant.new_data()
        mujoco.mj_resetDataKeyframe(plant.model, data, plant.key)
        data.joint("yaw").qvel[0], data.joint(axis_name).qvel[0] = w, rate
        mujoco.mj_forward(plant.model, data)
        axis = plant.axes[i]
        forces = axis.ideal(data.sensordata, data.qvel).accelerations
        reading = axis.pair_tilt.acceleration(*forces)
        true = axis.line.rate(data.qacc)
        assert reading - true == pytest.approx(
            w * plant.turning.coriolis[i][j] * rate, rel=1e-2
        )  # the free base gives a little
