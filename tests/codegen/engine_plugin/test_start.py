"""Plugins that set the flywheels going themselves: when they do, and that many rigs cost what they are."""

from __future__ import annotations

import time

import mujoco
import numpy as np
import pytest

from cmg_mj.plant.mujoco_state import quiet
from cmg_mj.plant.plugin_state import instance_states
from tests.codegen.engine_plugin.made import needs_compiler, quick

pytestmark = needs_compiler


def spinning(*settings: str) -> str:
    """The quick plugin's model, whose plugin sets the flywheels going; with further settings in its <config>."""
    text = quick().plugin.model.read_text(encoding="utf-8").replace('value="keyframe"', 'value="spinning"')
    return text.replace("</instance>", f"{''.join(settings)}</instance>")


def seed(number: int) -> str:
    return f'<config key="seed" value="{number}"/>'


@pytest.mark.filterwarnings("ignore:Attach conflict")
def test_many_rigs_in_one_model() -> None:
    """Each is the rig that stands alone, and the first step, which sets all going, costs like some others."""
    made, rigs = quick(), 8
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.integrator = made.model.opt.timestep, made.model.opt.integrator
    spec.option.disableflags = made.model.opt.disableflags
    for i in range(rigs):
        spec.attach(mujoco.MjSpec.from_string(spinning(seed(i))), prefix=f"rig{i}_", frame=spec.worldbody.add_frame())
    model = spec.compile()
    data, times, rows = mujoco.MjData(model), [], []
    for _ in range(12):
        start = time.process_time()
        mujoco.mj_step(model, data)
        times.append(time.process_time() - start)
        rows.append([data.sensor(f"rig{i}_balance/acceleration").data[0] for i in range(rigs)])
    assert times[0] < 30 * np.median(times[1:])
    for i in (0, rigs - 1):
        model = mujoco.MjModel.from_xml_string(spinning(seed(i)))
        data = mujoco.MjData(model)
        for row in rows:
            mujoco.mj_step(model, data)
            assert data.sensor("balance/acceleration").data[0] == row[i]
    assert rows[-1][0] != rows[-1][-1]


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
    assert instance_states(model, data)[0][2] == 2.0
    assert abs(data.qpos[gimbal] - 0.3) < 0.05
