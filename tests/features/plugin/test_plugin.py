"""A plugin in MuJoCo's own loop, over half a second: the runner's numbers, its state, wrong models."""

from __future__ import annotations

import copy
import pickle
import re
from collections.abc import Callable, Iterator

import mujoco
import numpy as np
import pytest

from cmg_mj import InputError
from cmg_mj.features.plugin.driver import FAILED, STATUS, instance_states, set_world
from cmg_mj.plant.mjcf import quiet
from tests.features.plugin.made import check_against_runner, needs_compiler, quick, run

pytestmark = needs_compiler

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


@pytest.fixture(autouse=True)
def _no_log() -> Iterator[None]:
    with quiet():
        yield


@pytest.fixture
def messages() -> Iterator[list[str]]:
    """What MuJoCo warns of."""
    result: list[str] = []
    mujoco.set_mju_user_warning(result.append)
    yield result
    mujoco.set_mju_user_warning(None)


def test_half_a_second_is_bit_for_bit() -> None:
    check_against_runner(quick())


def again(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
    """The same state in data that stood elsewhere."""
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    other = mujoco.MjData(model)
    mujoco.mj_step(model, other, 7)
    mujoco.mj_setState(model, other, state, STATE)
    return other


COPIES: dict[str, Callable[[mujoco.MjModel, mujoco.MjData], mujoco.MjData]] = {
    "copy": lambda model, data: copy.copy(data),
    "pickle": lambda model, data: pickle.loads(pickle.dumps(data)),
    "state": again,
}


@pytest.mark.parametrize("way", COPIES)
def test_what_is_copied_goes_on_as_the_original(way: str) -> None:
    made = quick()
    data = made.start()
    run(made, data, 13)
    for _ in range(3):  # a pass more changes nothing
        mujoco.mj_forward(made.model, data)
        mujoco.mj_inverse(made.model, data)
    other = COPIES[way](made.model, data)
    for name, rows in run(made, data, 20).items():
        np.testing.assert_array_equal(run(made, COPIES[way](made.model, other), 20)[name], rows, err_msg=name)


def test_passes_and_halves_of_steps_change_nothing() -> None:
    """With an integrator other than RK4, which mj_step1 and mj_step2 do not have."""
    made = quick()
    model = copy.copy(made.model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    whole, halves = (mujoco.MjData(model) for _ in range(2))
    for data in (whole, halves):
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    for _ in range(50):
        mujoco.mj_step(model, whole)
        mujoco.mj_forward(model, halves)
        mujoco.mj_step1(model, halves)
        halves.ctrl[:] = 1e3  # of the pair's drives, which are the plugin's
        mujoco.mj_step2(model, halves)
    np.testing.assert_array_equal(halves.qpos, whole.qpos)
    np.testing.assert_array_equal(halves.plugin_state, whole.plugin_state)


@pytest.mark.parametrize(("seed", "world"), [(2**53 + 1, 0), (0, -1), (1.5, 0)])
def test_numbers_that_no_state_holds(seed: int, world: int) -> None:
    with pytest.raises(InputError, match=r"^(seed|world) = "):
        set_world(quick().model, quick().start(), seed, world)


def test_a_world_that_a_program_writes_itself() -> None:
    """As docs/plugin.md says, also after the forward pass of an environment's reset."""
    made, ends = quick(), []
    for way in ("set_world", "numbers", "neither"):
        data = made.start()
        mujoco.mj_forward(made.model, data)
        if way == "numbers":
            (address,) = made.model.plugin_stateadr
            data.plugin_state[address : address + 2] = 0, 7
        elif way == "set_world":
            set_world(made.model, data, 0, 7)
        mujoco.mj_step(made.model, data, 20)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0], ends[2])


def test_a_plugin_of_others_is_left_alone() -> None:
    """Also one whose instance is named as if it were this package's."""
    pid = '<plugin plugin="mujoco.pid"><instance name="unbalance"><config key="ki" value="1"/></instance></plugin>'
    drive = '<plugin name="pid" joint="{}" plugin="mujoco.pid" instance="unbalance" actdim="1"/></actuator>'
    text = quick().plugin.model.read_text(encoding="utf-8").replace("</extension>", f"{pid}</extension>")
    text = re.sub("<key .*?/>", "", text.replace("</actuator>", drive.format("tilt")))
    model = mujoco.MjModel.from_xml_string(text)
    assert model.nplugin == 2
    assert len(instance_states(model, mujoco.MjData(model))) == 1
    alone = '<mujoco><extension>{}</extension><worldbody><body><joint name="j"/><geom size="1"/></body></worldbody>'
    model = mujoco.MjModel.from_xml_string(f"{alone.format(pid)}<actuator>{drive.format('j')}</mujoco>")
    with pytest.raises(InputError, match="has no plugin of cmg_mj's"):
        set_world(model, mujoco.MjData(model), 1, 0)


def test_noise_that_has_begun() -> None:
    data = quick().start()
    mujoco.mj_step(quick().model, data)
    with pytest.raises(InputError, match="right after a reset"):
        set_world(quick().model, data, 1, 0)
    mujoco.mj_resetData(quick().model, data)
    set_world(quick().model, data, 1, 0)


WRONG_CONFIGS = {
    "seed": (" ", "-1", "1.5", "9007199254740994"),
    "world": ("0x10", "nan", "+1"),
    "noise_density_ug_rthz": ("-400", "4e2x", "inf"),
    "counts_per_g": ("-1", "none", "1e300"),
    "counts_per_revolution": ("-4096", "12 bit"),
    "start": ("rest",),
    "build": ("0123456789abcdef",),
    "sead": ("1",),
}
WRONG_MODELS = {
    "another name": ("balance", "balanced", "must be named 'balance'"),
    "another plugin": ('plugin="cmg_mj[.]', 'plugin="cmg_mj.other_', "not found"),
    "a step that does not fit": (r'timestep="[^"]*"', 'timestep="0.003"', "a physics step of 0.003 s"),
    "sensors off": ("<flag ", '<flag sensor="disable" ', "leaves the controller blind"),
    "no inner accelerometer": ('name="accelerometer_inner"/>', 'name="inner"/>', "no sensor 'accelerometer_inner'"),
    "no servo": ('name="cube1/gimbal_servo"', 'name="servo"', "no actuator 'cube1/gimbal_servo'"),
    "another gimbal": ('"cube1/gimbal"', '"cube1/fork"', "no joint 'cube1/gimbal'"),
    "another encoder": ("<jointpos ", "<jointvel ", "sensor 'cube1/gimbal_encoder' is of another kind"),
    "a late accelerometer": ("<accelerometer ", '<accelerometer delay="0.01" nsample="3" ', "has a delay or a history"),
    "actuation off": ("<flag ", '<flag actuation="disable" ', "holds its drives"),
    "drives switched off": ("<option ", '<option actuatorgroupdisable="0" ', "'cube1/gimbal_servo' is in a group"),
    "a servo elsewhere": ('servo" joint="cube1/gimbal"', 'servo" joint="yaw"', "must drive joint 'cube1/gimbal'"),
    "a motor with a memory": ('biastype="affine" (gainprm="0.01")', r'dyntype="filter" \1', "must be a <velocity>"),
    "a gimbal that slides": ('name="cube1/gimbal" axis', r'type="slide" \g<0>', "joint 'cube1/gimbal' must be a hinge"),
    "a sensor of nothing": ("balance/tilt", "balance/tilted", "sensor 'balance/tilted': must be named"),
}


OTHER_SENSORS = """
<gyro name="turning" site="accelerometer_outer"/>
<accelerometer name="acceleration" site="accelerometer_outer"/>
<accelerometer name="late" site="accelerometer_outer" delay="0.007" nsample="9" interp="linear"/>
<accelerometer name="often" site="accelerometer_inner" nsample="5" interp="cubic"/>
<accelerometer name="seldom" site="accelerometer_inner" nsample="3" interval="0.015 -0.005"/>
<force name="push" site="accelerometer_outer"/>
<framelinacc name="frame" objtype="site" objname="accelerometer_outer"/>
<jointactuatorfrc name="torque" joint="cube1/gimbal"/>
<actuatorfrc name="drive" actuator="cube1/flywheel_motor"/>
<subtreeangmom name="momentum" body="frame"/>
<e_kinetic name="energy"/>
<clock name="clock"/>
"""


@pytest.mark.parametrize("key", WRONG_CONFIGS)
def test_a_wrong_config_does_not_compile(key: str) -> None:
    text = quick().plugin.model.read_text(encoding="utf-8")
    text = re.sub(rf'<config key="{key}".*?/>', "", text)
    for value in WRONG_CONFIGS[key]:
        with pytest.raises(ValueError, match=re.escape(key)) as error:
            mujoco.MjModel.from_xml_string(
                text.replace("</instance>", f'<config key="{key}" value="{value}"/></instance>')
            )
        assert f"{quick().plugin.name}: " in str(error.value) or "unrecognized attribute" in str(error.value)


@pytest.mark.parametrize("case", WRONG_MODELS)
def test_a_wrong_model_does_not_compile(case: str) -> None:
    pattern, replacement, message = WRONG_MODELS[case]
    text, n = re.subn(pattern, replacement, quick().plugin.model.read_text(encoding="utf-8"))
    assert n
    with pytest.raises(ValueError, match=re.escape(message)):
        mujoco.MjModel.from_xml_string(text)


def test_flywheels_that_a_program_has_left_at_rest() -> None:
    """With start="spinning" every pass before the first step sets them going: all is as if they had turned before."""
    made = quick()
    text = made.plugin.model.read_text(encoding="utf-8")
    model = mujoco.MjModel.from_xml_string(text.replace('value="keyframe"', 'value="spinning"'))
    data, ready = mujoco.MjData(model), made.start()
    for _ in range(2):  # as a Gymnasium environment's reset sets the state, and looks at it
        data.qpos[:2], data.qpos[2:] = ready.qpos[:2], 0.1
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
    mujoco.mj_step(model, data, 50)
    ready.qpos[3:6:2] = 0.1  # nobody sets the flywheels' angles
    mujoco.mj_step(made.model, ready, 50)
    np.testing.assert_array_equal(data.qpos, ready.qpos)
    np.testing.assert_array_equal(data.sensordata, ready.sensordata)


def test_a_step_that_is_changed_stops_the_gimbals() -> None:
    model, data = copy.copy(quick().model), quick().start()
    mujoco.mj_step(model, data, 50)
    model.opt.timestep = 0.001
    mujoco.mj_step(model, data, 50)
    assert data.sensor("balance/command").data == 0.0
    np.testing.assert_array_equal(data.act_dot, 0.0)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    mujoco.mj_step(model, data)
    assert data.sensor("balance/command").data != 0.0


@pytest.mark.parametrize("number", [np.nan, -1.0, 1e300])
def test_whatever_a_program_writes_into_the_state(number: float, messages: list[str]) -> None:
    """It stops with one warning, or takes the number for its memory; what it drives is never another actuator."""
    made = quick()
    model, data, before = made.model, mujoco.MjData(made.model), made.start()
    mujoco.mj_step(model, before, 7)
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, before, state, STATE)
    servos = [model.actuator(f"{module.name}/gimbal_servo").actadr[0] for module in made.experiment.plant.axis.modules]
    for place in range(model.npluginstate):
        messages.clear()
        mujoco.mj_setState(model, data, state, STATE)
        data.plugin_state[place] = number
        mujoco.mj_step(model, data, 8)
        has_stopped = data.plugin_state[STATUS] == FAILED
        assert len(messages) == has_stopped
        assert np.isfinite(data.sensordata).all()
        assert abs(data.sensor("balance/command").data) <= (0.0 if has_stopped else made.experiment.law.rate_limit)
        assert not (has_stopped and data.act_dot[servos].any())


def test_other_sensors_of_a_model_are_those_without_a_plugin() -> None:
    """The plugin computes accelerations a second time: no sensor shows it, nor any history or warm start."""
    made = quick()
    text = made.plugin.model.read_text(encoding="utf-8").replace("</sensor>", f"{OTHER_SENSORS}</sensor>")
    bare = re.sub(r"<extension>.*</extension>|<plugin name=.*?/>", "", text, flags=re.DOTALL)
    models = [mujoco.MjModel.from_xml_string(each) for each in (text, bare)]
    data, other = (mujoco.MjData(model) for model in models)
    for model, start in zip(models, (data, other), strict=True):
        mujoco.mj_resetDataKeyframe(model, start, model.key("start").id)
    names = [models[1].sensor(i).name for i in range(models[1].nsensor)]
    assert {"fog", "late", "often", "acceleration", "push"} <= set(names)
    for _ in range(60):
        mujoco.mj_step(models[0], data)
        for module in made.experiment.plant.axis.modules:
            other.actuator(f"{module.name}/gimbal_servo").ctrl = module.direction * data.sensor("balance/command").data
        mujoco.mj_step(models[1], other)
        for name in names:
            np.testing.assert_array_equal(data.sensor(name).data, other.sensor(name).data, err_msg=name)
        for name in ("qpos", "qvel", "qacc", "act", "qacc_warmstart", "history", "actuator_force"):
            np.testing.assert_array_equal(getattr(data, name), getattr(other, name), err_msg=name)


@pytest.mark.filterwarnings("ignore:Attach conflict")
def test_two_rigs_in_one_model() -> None:
    """Each is attached with a prefix and has an instance and a seed: each is the one that stands alone with it."""
    made = quick()
    spec, prefixes = mujoco.MjSpec(), {"a/": 5, "b_": 6}
    text = made.plugin.model.read_text(encoding="utf-8")
    spec.option.timestep, spec.option.integrator = made.model.opt.timestep, made.model.opt.integrator
    spec.option.disableflags = made.model.opt.disableflags
    for prefix in prefixes:
        seed = f'<config key="seed" value="{prefixes[prefix]}"/></instance>'
        rig = mujoco.MjSpec.from_string(text.replace("</instance>", seed))
        spec.attach(rig, prefix=prefix, frame=spec.worldbody.add_frame())
    model = spec.compile()
    data, single = mujoco.MjData(model), [made.start() for _ in prefixes]
    for name in ("qpos", "qvel", "act"):
        getattr(data, name)[:] = np.concatenate([getattr(alone, name) for alone in single])
    for seed, alone in zip(prefixes.values(), single, strict=True):
        set_world(made.model, alone, seed, 0)
    for _ in range(100):
        mujoco.mj_step(model, data)
        for alone, prefix in zip(single, prefixes, strict=True):
            mujoco.mj_step(made.model, alone)
            for quantity in ("estimate", "command", "acceleration"):
                shown = data.sensor(f"{prefix}balance/{quantity}").data
                np.testing.assert_array_equal(shown, alone.sensor(f"balance/{quantity}").data)
        np.testing.assert_array_equal(data.qpos, np.concatenate([alone.qpos for alone in single]))
        np.testing.assert_array_equal(data.qvel, np.concatenate([alone.qvel for alone in single]))
    assert single[0].sensor("balance/command").data != single[1].sensor("balance/command").data


@pytest.mark.parametrize(
    ("option", "value"), [("disableflags", int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)), ("disableactuator", 1)]
)
def test_drives_that_are_switched_off(option: str, value: int, messages: list[str]) -> None:
    """For a pass that is no step nothing happens; after a step u is 0 until a reset, with one warning."""
    model, data = copy.copy(quick().model), quick().start()
    mujoco.mj_step(model, data, 20)
    before = getattr(model.opt, option)
    setattr(model.opt, option, before | value)
    mujoco.mj_forward(model, data)
    assert messages == []
    mujoco.mj_step(model, data)
    setattr(model.opt, option, before)
    mujoco.mj_step(model, data, 20)
    assert len(messages) == 1
    assert data.sensor("balance/command").data == 0.0
    assert instance_states(model, data)[0][STATUS] == FAILED
    np.testing.assert_array_equal(data.act_dot, 0.0)
