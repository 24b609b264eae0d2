"""Plugins that set the flywheels going themselves: when they do, and that many rigs cost what they are."""

from __future__ import annotations

import copy
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cmg_mj.plant.mujoco_state import quiet
from cmg_mj.plant.plugin_state import FAILED, instance_states
from tests.codegen.engine_plugin.made import needs_compiler, quick

pytestmark = needs_compiler


def spinning(*settings: str) -> str:
    """The quick plugin's model, whose plugin sets the flywheels going; with further settings in its <config>."""
    text = quick().plugin.model.read_text(encoding="utf-8").replace('value="keyframe"', 'value="spinning"')
    return text.replace("</instance>", f"{''.join(settings)}</instance>")


def seed(number: int) -> str:
    return f'<config key="seed" value="{number}"/>'


def test_a_plugin_that_has_failed_sets_nothing_going() -> None:
    """A program has overwritten its state in the middle: it leaves the rig as it is."""
    model = mujoco.MjModel.from_xml_string(spinning())
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 20)
    data.plugin_state[:] = 0.0
    gimbal = model.joint("cube1/gimbal").qposadr[0]
    data.qpos[gimbal] = 0.3
    with quiet():
        mujoco.mj_step(model, data)
    assert instance_states(model, data)[0][2] == FAILED
    assert abs(data.qpos[gimbal] - 0.3) < 0.05


@pytest.mark.filterwarnings("ignore:Attach conflict")
def test_many_rigs_in_one_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is the rig that stands alone; the first step, which sets all going, computes velocities once more."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log of its warnings
    made, rigs = quick(), 8
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.integrator = made.model.opt.timestep, made.model.opt.integrator
    spec.option.disableflags = made.model.opt.disableflags
    for i in range(rigs):
        spec.attach(mujoco.MjSpec.from_string(spinning(seed(i))), prefix=f"rig{i}_", frame=spec.worldbody.add_frame())
    model = spec.compile()
    data, rows = mujoco.MjData(model), []
    passes = data.timer[mujoco.mjtTimer.mjTIMER_VELOCITY]
    counts = [passes.number]
    for _ in range(8):
        mujoco.mj_step(model, data)
        counts.append(passes.number)
        rows.append([data.sensor(f"rig{i}_balance/acceleration").data[0] for i in range(rigs)])
    assert np.diff(counts).tolist() == [5] + 7 * [4]  # the four of RK4
    for i in (0, rigs - 1):
        model = mujoco.MjModel.from_xml_string(spinning(seed(i)))
        data = mujoco.MjData(model)
        for row in rows:
            mujoco.mj_step(model, data)
            assert data.sensor("balance/acceleration").data[0] == row[i]
    assert rows[-1][0] != rows[-1][-1]


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
    assert [message.partition(": ")[2] for message in messages] == [
        "its drives were switched off during a step; u = 0 from now on"
    ]
    assert data.sensor("balance/command").data == 0.0
    assert instance_states(model, data)[0][2] == FAILED
    np.testing.assert_array_equal(data.act_dot, 0.0)
