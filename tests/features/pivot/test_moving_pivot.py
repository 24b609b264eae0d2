"""A pivot that moves: against a base driven by slide joints, and the same bits wherever a scenario runs."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.types import IdealReading
from cmg_mj.features.pivot import Pivot
from cmg_mj.features.pivot.moving_pivot import pivot_directions
from cmg_mj.features.pivot.pivot_signals import PivotSignals
from cmg_mj.plant.physics import OneWorld
from cmg_mj.results.summary_keys import section
from cmg_mj.runs.callback import control
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj
from tests.features.pivot.driven_base import DrivenBase
from tests.recorded import assert_same_bits, recorded

NOISE = 'pivot=[{kind="noise", acceleration_m_s2=0.3, corner_hz=5.0}]'
STEP_OF_NONE = '{kind="step", acceleration_m_s2=0.0}'
ALL_WAYS = [
    Pivot("sine", "across", 0.5, frequency_hz=3.0, phase_deg=40.0),
    Pivot("step", "along", 0.4, start_s=0.1, duration_s=0.2),
    Pivot("noise", "vertical", 0.6, corner_hz=10.0),
    Pivot("noise", "across", 0.3, corner_hz=5.0, start_s=0.05),
]


def experiment(*settings: str, scenario: str = "push_recovery", observer: str | None = None) -> Experiment:
    return prepare(load_scenario(scenario, ["duration_s=1.0", "push=[]", *settings], observer))


def signals(rig: Experiment, pivots: list[Pivot], worlds: int | list[int] = 0) -> PivotSignals:
    return PivotSignals(pivots, pivot_directions(rig.plant, pivots), 0, worlds)


# --- the physics -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("push_recovery", []),
        ("push_recovery", ["plant.timestep_s=0.001", "plant.lock_thrust_bearing=true"]),
        pytest.param("two_axes", ["plant.turn_rate_rad_s=0.0"], marks=pytest.mark.slow),
    ],
    ids=["free bearing", "1 ms", "two axes"],
)
def test_equals_a_base_that_slide_joints_drive(scenario: str, settings: list[str]) -> None:
    """Half a second with the loop open and the gimbals turning: joints and accelerometers to 1e-9."""
    rig = experiment(*settings, scenario=scenario)
    plant = rig.plant.with_own_model()
    axis = plant.axis_names[0] or None
    pivots = [Pivot(**{**vars_of(pivot), "axis": axis}) for pivot in ALL_WAYS]
    shifted, driven = OneWorld(plant), DrivenBase(plant)
    steps, held, h = round(0.5 / plant.timestep), round(0.005 / plant.timestep), plant.timestep

    move = PivotSignals(pivots, pivot_directions(plant, pivots), 0, 0, h)

    joints, readings = [], []
    for step in range(0, steps, held):
        acceleration = move.at(step, held).acceleration
        assert acceleration is not None
        shifted.accelerate(acceleration)
        driven.accelerate(acceleration)
        u = 0.5 * math.sin(20.0 * step * h)
        shifted.command(u)
        for servo, direction in zip(plant.axis.servos, plant.axis.directions, strict=True):
            driven.data.ctrl[servo] = direction * u
        shifted.reading([0.0] * plant.model.nv)
        readings.append(np.abs(shifted.data.sensordata - driven.sensordata()).max())
        shifted.advance(held)
        mujoco.mj_step(driven.model, driven.data, held)
        q, v = shifted.state()
        joints.append(np.abs(np.array([q, v]).T - driven.joints()).max())
    print(f"{scenario} {settings}: joints {max(joints):.1e}, sensors {max(readings):.1e}")
    assert np.abs(driven.travelled()).min() > 1e-3  # it moved every way
    assert max(joints) < 1e-9
    assert max(readings) < 1e-9


def vars_of(pivot: Pivot) -> dict[str, object]:
    return {name: getattr(pivot, name) for name in type(pivot).__dataclass_fields__}


def test_an_acceleration_across_tilts_what_accelerometers_see() -> None:
    """y1 = x1 - a/g, to the first order, and gravity's amplitude grows to the root of the sum of the squares."""
    rig = experiment("plant.equilibrium_bias_deg=0", "plant.initial_tilt_deg=0")
    physics = OneWorld(rig.plant.with_own_model())
    (across,) = pivot_directions(rig.plant, [Pivot("step", "across", 1.0)])
    assert across == pytest.approx([1.0, 0.0, 0.0])  # the bundled rig's tilt axis is y, and z leans to x
    physics.accelerate([0.5 * part for part in across])
    reading = physics.reading([0.0] * 6)
    assert isinstance(reading, IdealReading)
    assert rig.plant.pair_tilt(*reading.accelerations) == pytest.approx(-math.atan2(0.5, 9.81), abs=1e-9)


def test_directions_of_several_axes_are_those_of_their_lines() -> None:
    rig = experiment(scenario="two_axes")
    pivots = [
        Pivot("step", direction, 1.0, axis=axis)
        for axis in ("roll", "pitch")
        for direction in ("along", "across", "vertical")
    ]
    found = np.round(pivot_directions(rig.plant, pivots), 12)
    lines = {axis.name: axis for axis in rig.plant.axes}
    for i, name in enumerate(("roll", "pitch")):
        along, across, up = found[3 * i : 3 * i + 3]
        np.testing.assert_allclose(np.cross(along, up), across, atol=1e-12)
        data = rig.plant.new_data()
        mujoco.mj_resetDataKeyframe(rig.plant.model, data, rig.plant.key)
        mujoco.mj_forward(rig.plant.model, data)
        before = data.site(f"{name}/accelerometer_outer").xpos.copy()
        lines[name].line.tilt(data, 0.1)
        mujoco.mj_forward(rig.plant.model, data)
        moved = data.site(f"{name}/accelerometer_outer").xpos - before
        assert moved @ across > 0.9 * np.linalg.norm(moved)  # a positive tilt leans across


# --- the same wherever it runs ---------------------------------------------------------------------------------


def test_one_world_of_many_is_the_world_alone() -> None:
    """Bit for bit, whatever the number and the order of the worlds, and where their plants and sizes differ."""
    rig = experiment(NOISE, observer="gyro_free")
    alone = recorded(rig.run(world=3))
    many = recorded(rig.run_many([5, 3, 0]))
    vary = {"pivot.0.acceleration_m_s2": [0.1, 0.3], "equilibrium_bias_deg": [0.0, 0.5]}
    varied = recorded(rig.run_many([3, 3], settings=vary))
    assert_same_bits(many.world(1), alone)
    assert_same_bits(varied.world(1), alone)
    assert np.abs(varied["x1_rad"][:, 0] - alone["x1_rad"]).max() > 1e-3


def test_a_pivot_of_size_zero_is_at_rest() -> None:
    assert "floor_accel" in section(experiment(f"pivot=[{STEP_OF_NONE}]").run().summaries[0], "references")


def test_every_plant_of_a_batch_is_looked_at() -> None:
    rig = experiment(NOISE)
    held = rig.plant.with_own_model()
    held.model.body_gravcomp[2] = 1.0
    with pytest.raises(InputError, match="the body 'frame' has gravcomp"):
        rig.run_many(2, plants=[rig.plant, held])


def test_the_callback_sees_the_same() -> None:
    rig = experiment(NOISE, "duration_s=0.3")
    assert_same_bits(recorded(rig.run(driver="callback")), recorded(rig.run()))


def test_a_users_own_loop_moves_it_as_the_docs_say() -> None:
    rig = experiment(NOISE, "duration_s=0.3")
    expected = recorded(rig.run())
    plant, pivots = rig.plant.with_own_model(), rig.scenario.section("pivot")
    pivot = PivotSignals(pivots, pivot_directions(plant, pivots), seed=0, world_ids=0)
    still = plant.model.opt.gravity.copy()
    controller, data = rig.controller(), plant.new_data()
    tilts = []
    for k in range(60):
        tilts.append(plant.axis.line.lean(data.qpos) + plant.bias)
        plant.model.opt.gravity[:] = still - pivot.mean(k * 0.005, (k + 1) * 0.005)
        control(plant, controller, data)
        mujoco.mj_step(plant.model, data)
    np.testing.assert_array_equal(tilts, expected["x1_rad"])


def test_it_runs_again_from_its_own_folder_and_check_names_what_is_omitted(tmp_path: Path) -> None:
    scenario, track = tmp_path / "mine.toml", tmp_path / "walk.csv"
    track.write_text("t,a\n0,0.1\n0.2,-0.2\n", encoding="utf-8")
    scenario.write_text(
        "duration_s = 0.3\n[[pivot]]\nkind = 'track'\nfile = 'walk.csv'\n[[pivot]]\nkind = 'step'\n"
        "acceleration_m_s2 = 0.1\ndirection = 'vertical'\n",
        encoding="utf-8",
    )
    first = cmg_mj("run", scenario, "--json", "--out", tmp_path / "one")
    again = cmg_mj("run", tmp_path / "one" / "scenario.toml", "--json", "--out", tmp_path / "two")
    assert first.status == again.status == 0
    assert first.out == again.out
    checked = cmg_mj("check", scenario).out
    assert f"pivot       track, {track}, times 1, across, from 0 s" in checked
    assert "omitted     the pivot's acceleration: not in the reduced model, its loop, the ceiling" in checked


def test_the_plant_itself_stays_as_it_was() -> None:
    rig = experiment(NOISE, "duration_s=0.1")
    rig.run()
    rig.run_many(2)
    assert rig.plant.model.opt.gravity.tolist() == [0.0, 0.0, -9.81]


def test_there_is_no_floor_of_y1_with_its_acceleration() -> None:
    moving, still = (experiment(*more, "duration_s=0.1").run().summaries[0] for more in ([NOISE], []))
    assert "floor_accel" in section(still, "references")
    assert "floor_accel" not in section(moving, "references")
    assert "floor_y1" in section(moving, "references")


# --- what is refused -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pivot", "message"),
    [
        ('{kind="sine", acceleration_m_s2=1.0}', "pivot.0: a sine needs frequency_hz"),
        ('{kind="noise", acceleration_m_s2=-1.0, corner_hz=5.0}', "an RMS is not negative"),
        ('{kind="step", acceleration_m_s2=1.0, corner_hz=5.0}', "pivot.0: a step has no corner_hz; it has accel"),
        ('{kind="track"}', "pivot.0: a track needs file"),
        ('{kind="track", file="nowhere.csv"}', "pivot.0.file: nowhere.csv: no such file"),
        ('{kind="step", acceleration_m_s2=100.0}', "pivot.0.acceleration_m_s2 = 100.0: "),
        ('{kind="ramp"}', "pivot.0.kind = 'ramp': "),
        ('{direction="along"}', "pivot.0.kind: missing"),
        ('{kind="step", acceleration_m_s2=1.0, direction="up"}', "pivot.0.direction = 'up': "),
        ('{kind="step", acceleration_m_s2=1.0, start_s=2.0}', "pivot.0.start_s = 2: must be less than duration_s = 1"),
        ('{kind="step", acceleration_m_s2=1.0, axis="roll"}', "pivot.0.axis = 'roll': the rig has one axis"),
        ('{kind="sine", acceleration_m_s2=1.0, frequency_hz=30.0}', "pivot.0.frequency_hz = 30.0: "),
    ],
)
def test_what_no_pivot_does_is_refused(pivot: str, message: str) -> None:
    with pytest.raises(InputError) as refused:
        experiment(f"pivot=[{pivot}]")
    assert message in str(refused.value)


def test_a_track_that_is_scaled_beyond_all_recordings_is_named(tmp_path: Path) -> None:
    track = tmp_path / "walk.csv"
    track.write_text("t,a\n0,0.1\n0.2,-2.0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"pivot.0.scale = -600: .*walk.csv times this reaches 1.2e\+03 m/s2; at most"):
        experiment(f'pivot=[{{kind="track", file="{track}", scale=-600.0}}]')
    experiment(f'pivot=[{{kind="track", file="{track}", scale=-400.0}}]')


def test_a_frequency_that_the_control_rate_cannot_follow_is_refused() -> None:
    with pytest.raises(InputError, match=r"pivot.0.corner_hz = 15: .* at most 10 Hz at controller.rate_hz = 100"):
        experiment('pivot=[{kind="noise", acceleration_m_s2=1.0, corner_hz=15.0}]', "controller.rate_hz=100")


def test_several_axes_need_a_name() -> None:
    step = 'pivot=[{{kind="step", acceleration_m_s2=0.1{}}}]'
    with pytest.raises(InputError, match=r"pivot\.0\.axis: the rig has several axes: which of roll, pitch"):
        experiment(step.format(""), scenario="two_axes")
    with pytest.raises(
        InputError, match=r"pivot\.0\.axis = 'roll': is locked, and gives no direction; name one of pitch"
    ):
        experiment(step.format(', axis="roll"'), 'plant.locked_axes=["roll"]', scenario="two_axes")
    experiment(step.format(', direction="vertical"'), scenario="two_axes")


def test_a_model_that_gravity_alone_does_not_pull_is_refused() -> None:
    pivots = [Pivot("step", "across", 1.0)]
    in_air = experiment().plant.with_own_model()
    in_air.model.opt.density = 1.2
    with pytest.raises(InputError, match="the air's drag depends on the pivot's velocity"):
        pivot_directions(in_air, pivots)
    held = experiment().plant.with_own_model()
    held.model.body_gravcomp[2] = 1.0
    with pytest.raises(InputError, match="the body 'frame' has gravcomp"):
        pivot_directions(held, pivots)
    assert pivot_directions(held, []) == []


def test_the_plugin_refuses_it_by_name() -> None:
    from cmg_mj.features.plugin.make import describe_rig

    with pytest.raises(InputError, match="pivot: the pivot's acceleration"):
        describe_rig(experiment(NOISE), "plugin")
