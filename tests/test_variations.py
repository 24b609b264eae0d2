"""A rig that differs from its file by its settings is the rig of a file that says so."""

from __future__ import annotations

import math
import re
import shutil
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from cmg_mj.errors import InputError
from cmg_mj.experiment import prepare
from cmg_mj.known_rigs import known_rig
from cmg_mj.plant import Plant, load_plant
from cmg_mj.plant_settings import PlantSettings
from cmg_mj.resources import folder
from cmg_mj.scenario import load_scenario
from cmg_mj.trajectory import Trajectory

KP, KV = 60.0, 1.1


def edited(where: Path, file: str, *changes: tuple[str, str]) -> Path:
    """The scissored pair with one of its files changed."""
    for path in folder("models").glob("*.xml"):
        shutil.copy(path, where)
    text = (where / file).read_text()
    for pattern, by in changes:
        text, times = re.subn(pattern, by, text)
        assert times, pattern
    (where / file).write_text(text)
    return where / "scissored_pair.xml"


def run(*settings: str) -> Trajectory:
    """Half a second of `push_recovery`."""
    result = prepare(load_scenario("push_recovery", ["duration_s=0.5", "push=[]", *settings])).run()
    assert result.trajectory is not None
    return result.trajectory


def assert_same(by_setting: Trajectory, by_file: Trajectory) -> None:
    for name in by_file.columns:
        np.testing.assert_array_equal(by_setting[name], by_file[name], name)


# --- the servos -----------------------------------------------------------------------------------------------


def test_a_servo_by_settings_is_that_of_a_file(tmp_path: Path) -> None:
    path = edited(tmp_path, "cube.xml", ('kp="85.6" kv="0.731"', f'kp="{KP}" kv="{KV}"'))
    by_setting = run(f"plant.servo_stiffness_n_m_rad={KP}", f"plant.servo_damping_n_m_s_rad={KV}")
    assert_same(by_setting, run(f"plant.model={path}"))
    assert not np.array_equal(by_setting["x1_rad"], run()["x1_rad"])


def servo_torques(plant: Plant, error: float, rate: float) -> list[float]:
    """Of both servos with the setpoint ahead of the gimbal, which turns [N m]."""
    data = plant.new_data()
    for i, cube in enumerate(plant.cubes):
        data.act[i] = data.qpos[cube.gimbal] + error
        data.qvel[cube.gimbal] = rate
    mujoco.mj_forward(plant.model, data)
    return [float(data.qfrc_actuator[cube.gimbal]) for cube in plant.cubes]


@pytest.mark.parametrize("given", [{}, {"kp": KP}, {"kv": KV}, {"kp": KP, "kv": KV}])
def test_a_servos_torque_is_stiffness_times_error_less_damping_times_rate(given: dict[str, Any]) -> None:
    names = {"kp": "servo_stiffness_n_m_rad", "kv": "servo_damping_n_m_s_rad"}
    settings: dict[str, Any] = {names[name]: value for name, value in given.items()}
    plant = load_plant(PlantSettings(**settings))
    kp, kv = given.get("kp", 85.6), given.get("kv", 0.731)
    assert servo_torques(plant, 0.02, 0.3) == pytest.approx([kp * 0.02 - kv * 0.3] * 2, rel=1e-12)


def test_with_a_gear_they_count_at_the_joint(tmp_path: Path) -> None:
    path = edited(tmp_path, "cube.xml", ('(name="gimbal_servo")', r'\1 gear="2"'))
    plant = load_plant(model=str(path), servo_stiffness_n_m_rad=KP, servo_damping_n_m_s_rad=KV)
    data = plant.new_data()
    for i, cube in enumerate(plant.cubes):
        data.act[i] = 2.0 * (data.qpos[cube.gimbal] + 0.02)  # what the servo sees of a turn
        data.qvel[cube.gimbal] = 0.3
    mujoco.mj_forward(plant.model, data)
    assert data.qfrc_actuator[plant.cubes[0].gimbal] == pytest.approx(KP * 0.02 - KV * 0.3, rel=1e-12)


def test_a_stiffer_servo_gets_a_smaller_step() -> None:
    """An undamped gimbal on its servo swings at sqrt(kp/I), I = I_c + I_d; the step is 1.5 over that."""
    kp, inertia = 1000.0, 1.56e-3
    plant = load_plant(lock_thrust_bearing=True, servo_stiffness_n_m_rad=kp, servo_damping_n_m_s_rad=0.0)
    assert plant.largest_step == pytest.approx(1.5 / math.sqrt(kp / inertia), rel=2e-3)
    assert load_plant().largest_step == 0.005


@pytest.mark.parametrize("servo", ['<velocity name="gimbal_servo" joint="gimbal" kv="0.7"/>'])
def test_a_servo_of_another_kind_has_no_stiffness(servo: str, tmp_path: Path) -> None:
    path = edited(tmp_path, "scissored_pair.xml", (r'act="[^"]*" ', ""))
    text = (tmp_path / "cube.xml").read_text()
    (tmp_path / "cube.xml").write_text(re.sub(r"<intvelocity[^>]*/>", servo, text))
    for name in ("servo_stiffness_n_m_rad", "servo_damping_n_m_s_rad"):
        with pytest.raises(
            InputError, match=rf"plant\.{name}: .*pair\.xml: actuator 'cube1/gimbal_servo' is no position"
        ):
            load_plant(PlantSettings(**{"model": str(path), name: 1.0}))


# --- all of them ----------------------------------------------------------------------------------------------

GIVEN: dict[str, Any] = {"servo_stiffness_n_m_rad": KP, "servo_damping_n_m_s_rad": 0.0}


@pytest.mark.parametrize("name", GIVEN)
def test_a_changed_rig_is_not_taken_for_a_known_one(name: str) -> None:
    assert known_rig(PlantSettings(**{name: GIVEN[name]})) is None


@pytest.mark.parametrize("name", GIVEN)
def test_it_stands_in_the_resolved_scenario(name: str) -> None:
    experiment = prepare(load_scenario("push_recovery", [f"plant.{name}={GIVEN[name]}"]))
    assert experiment.resolved()["plant"][name] == GIVEN[name]
    assert experiment.differences[f"plant.{name}"] == GIVEN[name]
    assert name not in prepare(load_scenario("push_recovery")).resolved()["plant"]
