"""A rig that differs from its file by its settings is the rig of a file that says so."""

from __future__ import annotations

import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.tilt import PairTilt
from cmg_mj.inputs.files import folder
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.plant_settings import PlantSettings
from tests.plant import paper_model as paper
from tests.recorded import assert_same_bits, push_recovery, recorded

KP, KV = 60.0, 1.1


def edit(target: Path, file: str, *changes: tuple[str, str]) -> Path:
    """The scissored pair with one of its files changed."""
    for path in folder("models").glob("*.xml"):
        shutil.copy(path, target)
    text = (target / file).read_text()
    for pattern, replacement in changes:
        text, times = re.subn(pattern, replacement, text)
        assert times, pattern
    (target / file).write_text(text)
    return target / "scissored_pair.xml"


def run(*settings: str) -> Trajectory:
    """Half a second of `push_recovery`."""
    return recorded(push_recovery("duration_s=0.5", "push=[]", *settings).run())


# --- the servos -----------------------------------------------------------------------------------------------


def test_a_servo_by_settings_is_that_of_a_file(tmp_path: Path) -> None:
    path = edit(tmp_path, "cube.xml", ('kp="85.6" kv="0.731"', f'kp="{KP}" kv="{KV}"'))
    by_setting = run(f"plant.servo_stiffness_n_m_rad={KP}", f"plant.servo_damping_n_m_s_rad={KV}")
    assert_same_bits(by_setting, run(f"plant.model={path}"))
    assert not np.array_equal(by_setting["x1_rad"], run()["x1_rad"])


def servo_torques(plant: Plant, error: float, rate: float) -> list[float]:
    """Return the torques of both servos with the setpoint ahead of the gimbal, which turns [N m]."""
    data = plant.new_data()
    for i, module in enumerate(plant.axis.modules):
        data.act[i] = data.qpos[module.gimbal] + error
        data.qvel[module.gimbal] = rate
    mujoco.mj_forward(plant.model, data)
    return [float(data.qfrc_actuator[module.gimbal]) for module in plant.axis.modules]


@pytest.mark.parametrize("arguments", [{}, {"kp": KP}, {"kv": KV}, {"kp": KP, "kv": KV}])
def test_a_servos_torque_is_stiffness_times_error_less_damping_times_rate(arguments: dict[str, Any]) -> None:
    names = {"kp": "servo_stiffness_n_m_rad", "kv": "servo_damping_n_m_s_rad"}
    settings: dict[str, Any] = {names[name]: value for name, value in arguments.items()}
    plant = load_plant(PlantSettings(**settings))
    kp, kv = arguments.get("kp", 85.6), arguments.get("kv", 0.731)
    assert servo_torques(plant, 0.02, 0.3) == pytest.approx([kp * 0.02 - kv * 0.3] * 2, rel=1e-12)


def test_with_a_gear_they_count_at_the_joint(tmp_path: Path) -> None:
    path = edit(tmp_path, "cube.xml", ('(name="gimbal_servo")', r'\1 gear="2"'))
    plant = load_plant(model=str(path), servo_stiffness_n_m_rad=KP, servo_damping_n_m_s_rad=KV)
    data = plant.new_data()
    for i, module in enumerate(plant.axis.modules):
        data.act[i] = 2.0 * (data.qpos[module.gimbal] + 0.02)  # what the servo sees of a turn
        data.qvel[module.gimbal] = 0.3
    mujoco.mj_forward(plant.model, data)
    assert data.qfrc_actuator[plant.axis.modules[0].gimbal] == pytest.approx(KP * 0.02 - KV * 0.3, rel=1e-12)


def test_a_stiffer_servo_gets_a_smaller_step() -> None:
    """An undamped gimbal on its servo swings at sqrt(kp/I), I = I_c + I_d; the step is 1.5 over that."""
    kp, inertia = 1000.0, 1.56e-3
    plant = load_plant(lock_thrust_bearing=True, servo_stiffness_n_m_rad=kp, servo_damping_n_m_s_rad=0.0)
    assert plant.largest_step == pytest.approx(1.5 / math.sqrt(kp / inertia), rel=2e-3)
    assert load_plant().largest_step == 0.005


def test_a_servo_of_another_kind_has_no_stiffness(tmp_path: Path) -> None:
    path = edit(tmp_path, "scissored_pair.xml", (r'act="[^"]*" ', ""))
    edited = (tmp_path / "scissored_pair.xml").read_text()
    edit(tmp_path, "cube.xml", (r"<intvelocity[^>]*/>", '<velocity name="gimbal_servo" joint="gimbal" kv="0.7"/>'))
    path.write_text(edited)
    for name in ("servo_stiffness_n_m_rad", "servo_damping_n_m_s_rad"):
        with pytest.raises(InputError, match=rf"plant\.{name}: .*actuator 'cube1/gimbal_servo'"):
            load_plant(PlantSettings(**{"model": str(path), name: 1.0}))


# --- the flywheels --------------------------------------------------------------------------------------------


def test_flywheels_by_a_setting_are_those_of_a_file(tmp_path: Path) -> None:
    path = edit(tmp_path, "scissored_pair.xml", (r"\b314\b", "200"))
    weights = "controller.lqr.state_cost=[100.0,1.0,1.0,0.1]"
    assert_same_bits(run("plant.flywheel_speed_rad_s=200", weights), run(f"plant.model={path}", weights))


@pytest.mark.parametrize("model", ["scissored_pair.xml", "single_gimbal.xml"])
def test_the_momentum_is_inertia_times_speed(model: str) -> None:
    """Turned a quarter back, a wheel spins about the tilt axis: its share of the angular momentum there is J w."""
    J_d, speed = paper.J_d, 123.0
    plant = load_plant(model=model, flywheel_speed_rad_s=speed)
    assert [abs(module.speed) for module in plant.axis.modules] == [speed] * len(plant.axis.modules)
    assert plant.reduced.omega_d == pytest.approx(speed, rel=1e-12)
    assert plant.reduced.J_d * plant.reduced.omega_d == pytest.approx(J_d * speed, rel=1e-12)
    default_plant = load_plant(model=model)
    directions = [[module.direction for module in rig.axis.modules] for rig in (plant, default_plant)]
    assert directions[0] == directions[1]
    assert replace(plant.reduced, omega_d=default_plant.reduced.omega_d) == default_plant.reduced
    data = plant.new_data()
    for module in plant.axis.modules:
        data.qpos[module.gimbal] = module.gimbal_zero - module.direction * math.pi / 2.0
    mujoco.mj_forward(plant.model, data)
    mujoco.mj_subtreeVel(plant.model, data)
    momentum = data.subtree_angmom[plant.axis.frame] @ data.xaxis[plant.tilt]
    assert momentum == pytest.approx(len(plant.axis.modules) * J_d * speed, rel=1e-12)


def test_changed_back_it_is_the_rig_it_was() -> None:
    plant = load_plant()
    slow = Plant(plant.filed, PlantSettings(flywheel_speed_rad_s=100.0))
    back = Plant(slow.filed, PlantSettings())
    assert (back.axis.modules, back.reduced) == (plant.axis.modules, plant.reduced)
    assert slow.reduced.omega_d == pytest.approx(100.0)
    np.testing.assert_array_equal(back.model.key_qvel, plant.model.key_qvel)


def test_a_motor_that_takes_no_such_speed(tmp_path: Path) -> None:
    path = edit(tmp_path, "cube.xml", ('(name="flywheel_motor")', r'\1 ctrllimited="true" ctrlrange="-400 400"'))
    assert load_plant(model=str(path), flywheel_speed_rad_s=400.0)
    complaint = r"plant\.flywheel_speed_rad_s = 401: .*'cube1/flywheel_motor' takes only -400 to 400 rad/s"
    with pytest.raises(InputError, match=complaint):
        load_plant(model=str(path), flywheel_speed_rad_s=401.0)


# --- the accelerometers ---------------------------------------------------------------------------------------

INNER, OUTER = 0.05, 0.25


def move_sites(target: Path) -> Path:
    """The file with its accelerometers on the diagonal of x and z at other distances."""

    def site(name: str, radius: float) -> tuple[str, str]:
        coordinate = radius / math.sqrt(2.0)
        return rf'(name="accelerometer_{name}" pos=)"[^"]*"', rf'\1"{coordinate!r} 0 {coordinate!r}"'

    return edit(target, "scissored_pair.xml", site("inner", INNER), site("outer", OUTER))


def test_accelerometers_by_settings_are_those_of_a_file(tmp_path: Path) -> None:
    path = move_sites(tmp_path)
    plant = load_plant(accelerometer_inner_m=INNER, accelerometer_outer_m=OUTER)
    file_plant = load_plant(model=str(path))
    assert plant.pair_tilt == PairTilt(INNER, OUTER)
    for model, other in ((plant.model, file_plant.model), (plant.drawn_model, file_plant.drawn_model)):
        np.testing.assert_allclose(model.site_pos, other.site_pos, rtol=0.0, atol=1e-15)
    by_setting = run(f"plant.accelerometer_inner_m={INNER}", f"plant.accelerometer_outer_m={OUTER}")
    np.testing.assert_allclose(by_setting["y1_rad"], run(f"plant.model={path}")["y1_rad"], rtol=0.0, atol=1e-9)


ASIDE = {"inner": (0.12, 0.15, 4.0), "outer": (-0.03, -0.02, -100.0)}
"""Up and across from the pivot [m], and the angle from across to the first axis [deg]."""
BY_SETTINGS = {
    f"accelerometer_{name}_{field}": value
    for name, values in ASIDE.items()
    for field, value in zip(("m", "across_m", "angle_deg"), values, strict=True)
}


def aside_in_a_file(target: Path) -> Path:
    """Copy the bundled rig with accelerometers beside the radial line, which at a tilt of 0 leans by 45 deg in it."""

    def site(name: str) -> tuple[str, str]:
        up, across, angle = ASIDE[name]
        x, z = (up + across) / math.sqrt(2.0), (up - across) / math.sqrt(2.0)
        pattern = rf'(name="accelerometer_{name}") pos="[^"]*" euler="[^"]*"'
        return pattern, rf'\1 pos="{x!r} 0 {z!r}" euler="0 {math.radians(45.0 - angle)!r} 0"'

    return edit(target, "scissored_pair.xml", site("inner"), site("outer"))


@pytest.mark.parametrize("by_file", [True, False])
def test_accelerometers_anywhere_in_the_tilting_plane_show_the_motion(by_file: bool, tmp_path: Path) -> None:
    where: dict[str, Any] = {"model": str(aside_in_a_file(tmp_path))} if by_file else BY_SETTINGS
    plant = load_plant(lock_thrust_bearing=True, **where)
    tilt = plant.pair_tilt
    found = [(*place, math.degrees(angle)) for place, angle in zip(tilt.places, tilt.angles, strict=True)]
    np.testing.assert_allclose(found, list(ASIDE.values()), atol=1e-12)
    data = plant.new_data()
    rng = np.random.default_rng(3)
    for angle, rate in rng.uniform(-3.0, 3.0, (20, 2)):
        data.qpos[plant.tilt], data.qvel[plant.tilt] = plant.tilt_zero + angle, rate
        mujoco.mj_forward(plant.model, data)
        forces = plant.ideal_readings(data.sensordata.tolist(), data.qvel.tolist()).accelerations
        assert tilt(*forces) == pytest.approx(angle, abs=1e-9)
        assert tilt.acceleration(*forces) == pytest.approx(data.qacc[plant.tilt], abs=1e-9)


def test_misplaced_they_feel_what_is_there_and_the_estimate_knows_the_old_places() -> None:
    """At rest nothing shows; a turn shows in y1, and its acceleration by the wrong distance."""
    off = PlantSettings(accelerometer_inner_misplaced_mm=3.0, accelerometer_outer_misplaced_mm=-5.0)
    assert load_plant(off).pair_tilt == load_plant().pair_tilt
    places = {"accelerometer_inner_m": INNER, "accelerometer_outer_m": OUTER}
    plant = load_plant(replace(off, **places, lock_thrust_bearing=True))
    assert plant.pair_tilt == PairTilt(INNER, OUTER)
    data = plant.new_data()
    span, rate = OUTER - INNER - 0.008, 3.0
    data.qpos[plant.tilt], data.qvel[plant.tilt] = plant.tilt_zero + 0.2, rate
    mujoco.mj_forward(plant.model, data)
    alpha = float(data.qacc[plant.tilt])
    ix, iz, ox, oz = plant.ideal_readings(data.sensordata.tolist(), data.qvel.tolist()).accelerations
    assert ox - ix == pytest.approx(span * alpha, rel=1e-12)
    assert oz - iz == pytest.approx(-span * rate**2, rel=1e-12)
    assert ix == pytest.approx((INNER + 0.003) * alpha - 9.81 * math.sin(0.2), rel=1e-12)
    assert plant.pair_tilt.acceleration(ix, iz, ox, oz) == pytest.approx(alpha * span / (OUTER - INNER), rel=1e-12)
    assert abs(plant.pair_tilt(ix, iz, ox, oz) - 0.2) > 1e-3
    drawn = {name: plant.drawn_model.site(name).pos for name in ("accelerometer_inner", "accelerometer_outer")}
    assert math.dist(*drawn.values()) == pytest.approx(span, rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ((0.2, 0.1), r"inner_m = 0\.2, plant\.accelerometer_outer_m = 0\.1: the inner .* 0\.2 and 0\.1 m away"),
        ((0.2, 0.2), "must lie nearer"),
        ((0.3, None), r"plant\.accelerometer_inner_m = 0\.3: .* 0\.3 and 0\.201525 m away"),
        ((None, None, 200.0), r"inner_misplaced_mm = 200: the inner .* 0\.267175 and 0\.201525 m away"),
        ((None, 0.05), r"plant\.accelerometer_outer_m = 0\.05: .* 0\.0671751 and 0\.05 m away"),
    ],
)
def test_the_inner_one_is_the_inner_one(arguments: tuple, complaint: str) -> None:
    fields = "accelerometer_inner_m", "accelerometer_outer_m", "accelerometer_inner_misplaced_mm"
    values = dict(zip(fields, arguments, strict=False))
    with pytest.raises(InputError, match=complaint):
        load_plant(**values)


def test_two_below_the_pivot_are_in_order_too() -> None:
    plant = load_plant(accelerometer_inner_m=-0.05, accelerometer_outer_m=-0.2, lock_thrust_bearing=True)
    data = plant.new_data()
    data.qpos[plant.tilt] = plant.tilt_zero + 0.2
    mujoco.mj_forward(plant.model, data)
    forces = plant.ideal_readings(data.sensordata.tolist(), data.qvel.tolist()).accelerations
    assert plant.pair_tilt(*forces) == pytest.approx(0.2, abs=1e-9)
