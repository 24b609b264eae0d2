"""A frame that bends: its mode in closed form, what it leaves as it was, and what does not go with it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.bend import STEP_SHARE, Bend, BendBeyond
from cmg_mj.features.bend.verdict import rk4_energy_loss
from cmg_mj.plant.elements import BEND_JOINT
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.summary_keys import section
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario, parse_scenario
from tests.features.plugin.made import assert_same_run, needs_compiler
from tests.recorded import recorded

SENSORS = ("accelerometer_inner", "accelerometer_outer", "fog")


def bending(hz: float, beyond: BendBeyond = "sensors", share: float = 0.2, damping: float = 0.01, **more: Any) -> Plant:
    """The scissored pair with a bend."""
    return load_plant(sections={"bend": Bend(hz, damping, share, beyond)}, **more)


def ring(plant: Plant, seconds: float = 1.0) -> tuple[np.ndarray, float]:
    """Let go of a frame bent by 1 mrad, hinge free, wheels stopped, gravity off.

    Returns:
        The bend's angle at each step [rad], and the energy at the end over that at the start.
    """
    model, data = plant.model, plant.new_data()
    model.opt.gravity[:] = 0.0
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    mujoco.mj_resetDataKeyframe(model, data, plant.key)
    data.qvel[:] = data.ctrl[:] = 0.0
    bend = int(model.joint(BEND_JOINT).qposadr[0])
    data.qpos[bend] = 1e-3
    mujoco.mj_forward(model, data)
    before, angles = float(data.energy.sum()), [1e-3]
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        angles.append(float(data.qpos[bend]))
    mujoco.mj_forward(model, data)
    return np.array(angles), float(data.energy.sum()) / before


def frequency(angles: np.ndarray, step: float) -> float:
    """The frequency of a decaying sine, from its crossings of zero downward."""
    at = np.flatnonzero((angles[:-1] > 0.0) & (angles[1:] <= 0.0))
    times = (at + angles[at] / (angles[at] - angles[at + 1])) * step
    return float((len(times) - 1) / (times[-1] - times[0]))


@pytest.mark.daily_cases("10-0.0-sensors-0.2-True", "20-0.02-both-0.8-False", "20-0.02-modules-0.8-False")
@pytest.mark.parametrize("lock", [True, False])
@pytest.mark.parametrize(("beyond", "share"), [("sensors", 0.2), ("sensors", 0.5), ("modules", 0.8), ("both", 0.8)])
@pytest.mark.parametrize("damping", [0.0, 0.02])
@pytest.mark.parametrize("hz", [10, 20, 40])
def test_frequency_and_energy_are_those_asked_for(
    hz: float, damping: float, beyond: BendBeyond, share: float, lock: bool
) -> None:
    plant = bending(hz, beyond, share, damping, lock_thrust_bearing=lock)
    angles, left = ring(plant)
    damped = hz * math.sqrt(1.0 - damping**2)
    assert frequency(angles, plant.timestep) == pytest.approx(damped, rel=1e-3)
    # To the physics steps goes what z^6/72 a step says, and the swing about the mean loss shows the phase.
    expected = math.exp(-4.0 * math.pi * damping * hz) * (1.0 - rk4_energy_loss(hz, plant.timestep))
    assert left == pytest.approx(expected, rel=1e-2 if damping == 0.0 else 4.0 * damping)
    if damping == 0.0:
        assert 1.0 - left == pytest.approx(rk4_energy_loss(hz, plant.timestep), rel=0.02)


def test_a_step_that_is_too_long_would_take_the_energy() -> None:
    assert rk4_energy_loss(40.0, 0.005) > 0.99
    assert rk4_energy_loss(40.0, STEP_SHARE / (80.0 * math.pi)) == pytest.approx(0.0034, rel=0.01)


@pytest.mark.parametrize(("beyond", "share"), [("sensors", 0.2), ("both", 0.5)])
def test_mass_and_inertia_are_split_and_not_changed(beyond: BendBeyond, share: float) -> None:
    rigid, plant = load_plant(), bending(20.0, beyond, share)
    assert plant.model.body_subtreemass[0] == pytest.approx(rigid.model.body_subtreemass[0], rel=1e-14)
    for name in ("J1", "J2", "J_d", "omega_d", "gravity_torque"):
        assert getattr(plant.reduced, name) == pytest.approx(getattr(rigid.reduced, name), rel=1e-12), name
    dense = np.zeros((plant.model.nv, plant.model.nv))
    data = mujoco.MjData(plant.model)
    mujoco.mj_resetDataKeyframe(plant.model, data, plant.key)
    mujoco.mj_forward(plant.model, data)
    mujoco.mj_fullM(plant.model, data, dense)
    tilt, bend = (int(plant.model.joint(name).dofadr[0]) for name in ("tilt", BEND_JOINT))
    beyond_share = share if beyond == "sensors" else 1.0 - share
    assert dense[bend, bend] / dense[tilt, tilt] == pytest.approx(beyond_share, rel=2e-3)  # e moves a little


def test_the_bias_turns_the_whole_plants_centre_of_mass() -> None:
    rigid, plant = (load_plant(equilibrium_bias_deg=1.5, sections={"bend": Bend(hz)}) for hz in (0.0, 20.0))
    centres = []
    for other in (rigid, plant):
        data = mujoco.MjData(other.model)
        mujoco.mj_resetDataKeyframe(other.model, data, other.key)
        mujoco.mj_forward(other.model, data)
        centres.append(data.subtree_com[other.axis.frame].copy())
    np.testing.assert_allclose(centres[1], centres[0], atol=1e-12)


@pytest.mark.parametrize(
    ("beyond", "share", "body"), [("sensors", 0.2, BEND_JOINT), ("modules", 0.8, BEND_JOINT), ("both", 0.5, "frame")]
)
def test_where_the_sensors_sit(beyond: BendBeyond, share: float, body: str) -> None:
    plant = bending(20.0, beyond, share)
    for model in (plant.model, plant.drawn_model):
        assert {model.body(int(model.site_bodyid[model.site(name).id])).name for name in SENSORS} == {body}
        np.testing.assert_allclose(model.site("fog").pos, [0.14, 0.0, 0.14])


def test_a_perfect_gyro_and_tilt_are_those_of_the_sensors_part() -> None:
    plant = bending(20.0)
    data = plant.new_data()
    tilt, bend = (int(plant.model.joint(name).dofadr[0]) for name in ("tilt", BEND_JOINT))
    data.qvel[tilt], data.qvel[bend] = 0.3, 0.2
    mujoco.mj_forward(plant.model, data)
    reading = plant.axis.ideal(data.sensordata, data.qvel)
    assert reading.rate == pytest.approx(0.3)
    assert reading.gyro == pytest.approx(0.5)


def test_the_step_follows_the_mode() -> None:
    assert load_plant().largest_step == 0.005
    assert bending(2.0).largest_step == 0.005
    assert bending(40.0).largest_step * 80.0 * math.pi == pytest.approx(STEP_SHARE)


def short(*settings: str) -> Experiment:
    return prepare(load_scenario("push_recovery", ["duration_s=0.5", "push=[]", "observer.kind=linear", *settings]))


def trajectory(experiment: Experiment) -> Trajectory:
    return recorded(experiment.run())


def test_a_stiff_frame_moves_as_a_rigid_one() -> None:
    quiet = ("sensors.accelerometer.noise_density_ug_rthz=0", "duration_s=0.1")
    rigid = trajectory(short(*quiet, "plant.timestep_s=0.0005"))
    stiff = trajectory(short(*quiet, "plant.timestep_s=0.000125", "bend.frequency_hz=300"))
    np.testing.assert_allclose(stiff["x1_rad"], rigid["x1_rad"], rtol=2e-3)


def test_without_a_frequency_the_other_fields_change_nothing() -> None:
    assert_same_run(short("bend.share=0.5", "bend.beyond=both").run(), short().run())


def test_one_world_a_batch_and_the_callback_are_the_same_bits() -> None:
    experiment = short("bend.frequency_hz=15", "controller.notch_hz=16", "observer.kind=homogeneous")
    one = experiment.run(world=1)
    assert_same_run(one, experiment.run(world=1, driver="callback"))
    assert_same_run(one, experiment.run_many([1]))
    assert BEND_JOINT in experiment.plant.joint_names


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("beyond", ["sensors", "both"])
def test_the_plugins_model_has_the_bend(beyond: BendBeyond) -> None:
    experiment = short("bend.frequency_hz=15", f"bend.beyond={beyond}", "bend.share=0.5")
    assert_same_run(experiment.run(), experiment.run("plugin"))


def test_floors_that_a_bend_would_belie_are_not_printed() -> None:
    bending, rigid = (short(f"bend.frequency_hz={hz}").run().summaries[0] for hz in (15, 0))
    assert "floor_accel" not in section(bending, "references")
    assert "floor_accel" in section(rigid, "references")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            ["plant.timestep_s=0.005"],
            "plant.timestep_s = 0.005: does not follow a bend of 20 Hz, which takes at most 0.00",
        ),
        (["plant.integrator=implicitfast"], "plant.integrator = 'implicitfast': follows no bend"),
        (
            ["bend.share=0.7"],
            "bend.share = 0.7: .* with bend.beyond = 'sensors' set bend.share to at most 0.694",
        ),
        (["bend.beyond=both"], "bend.share = 0.2: .* = 'both' set bend.share to at least 0.306"),
        (["bend.beyond=modules"], "bend.share = 0.2: .* = 'modules' set bend.share to at least 0.306"),
        (["bend.beyond=modules", "bend.share=0.8", "plant.tilt_friction_n_m=0.1"], "plant.tilt_friction_n_m = 0.1: "),
        (["plant.model=two_axes.xml"], "tilts about several axes, and a bend takes one; lock the others"),
    ],
)
def test_what_does_not_go_with_a_bend(settings: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        prepare(load_scenario("push_recovery", ["bend.frequency_hz=20", *settings]))


@pytest.mark.parametrize(("beyond", "share"), [("sensors", 0.694), ("modules", 0.306)])
def test_the_share_that_a_refusal_names_is_allowed(beyond: BendBeyond, share: float) -> None:
    assert bending(20.0, beyond, share).bends


HINGE_TORQUES: dict[str, tuple[str, Any, str | None]] = {
    "damping": ("damping", [0.1, 0.0, 0.0], "tilt_damping_n_m_s"),
    "frictionloss": ("frictionloss", 0.1, "tilt_friction_n_m"),
    "stiffness": ("stiffness", [0.1, 0.0, 0.0], None),
}


@pytest.mark.parametrize("torque", HINGE_TORQUES)
def test_torques_of_the_hinge_in_the_file_do_not_act_beyond_a_bend(tmp_path: Path, torque: str) -> None:
    """They are refused by name, if the settings do not take them away; before the bend they stay."""
    attribute, value, field = HINGE_TORQUES[torque]
    spec = mujoco.MjSpec.from_file(str(load_plant().path))
    setattr(spec.joint("tilt"), attribute, value)
    model = tmp_path / "rig.xml"
    model.write_text(spec.to_xml(), encoding="utf-8")
    words = rf"bend.beyond = 'both': .*rig.xml: the {torque} of joint 'tilt' would act on .*; "
    with pytest.raises(InputError, match=words + (f"set plant.{field}=0, or take" if field else "take it out of")):
        bending(20.0, "both", 0.5, model=str(model))
    bending(20.0, "sensors", 0.5, model=str(model))
    if field:
        without = bending(20.0, "both", 0.5, model=str(model), **{field: 0.0})
        assert not without.model.dof_damping[without.axis.line.dof]
        assert not without.model.dof_frictionloss[without.axis.line.dof]


def test_one_axis_of_two_may_bend() -> None:
    settings = ["bend.frequency_hz=20", 'plant.locked_axes=["roll"]', "push=[]", "swing=[]", "duration_s=0.2"]
    experiment = prepare(load_scenario("two_axes", settings))
    assert experiment.plant.joint_names.count(BEND_JOINT) == 1
    angles, _ = ring(experiment.plant)
    assert frequency(angles, experiment.plant.timestep) == pytest.approx(20.0, rel=1e-3)


def test_a_run_of_0_2_0_which_had_the_bend_in_plant_runs_again() -> None:
    written = {"versions": {"cmg_mj": "0.2.0"}, "plant": {"bend_frequency_hz": 20.0, "bend_share": 0.1}}
    assert parse_scenario(written).section("bend") == Bend(20.0, share=0.1)
    with pytest.raises(InputError, match=r"plant\.bend_share: no such field; did you mean 'bend\.share'"):
        parse_scenario({"plant": {"bend_share": 0.1}})


@pytest.mark.parametrize(("sections", "words"), [({"bent": 1}, "no such section"), ({"bend": {}}, "must be a Bend")])
def test_sections_of_a_plant_are_checked(sections: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_plant(sections=sections)
