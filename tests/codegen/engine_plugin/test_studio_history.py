"""A plugin in MuJoCo Studio's history: back to a frame, and on from there."""

from __future__ import annotations

from importlib import import_module

import mujoco
import numpy as np

from tests.codegen.engine_plugin.made import needs_compiler, quick

pytestmark = needs_compiler
sim, ux = (import_module(f"mujoco.studio.{name}") for name in ("sim", "ux"))  # compiled, without type stubs


def test_scrubbed_back_it_goes_on_exactly() -> None:
    made = quick()
    model, data = made.model, made.start()
    history, head = sim.SimHistory(), ux.UxState()
    ux.reset_history(history, head, model, data)
    rows = []
    for _ in range(60):
        mujoco.mj_step(model, data)
        ux.record_history(history, head, model, data)
        rows.append(np.concatenate([data.qpos, data.qvel, data.act, data.sensordata]))
    for back in (1, 25, 40):
        ux.load_history_frame(history, model, data, -back)
        for row in rows[60 - back :]:
            mujoco.mj_step(model, data)
            np.testing.assert_array_equal(np.concatenate([data.qpos, data.qvel, data.act, data.sensordata]), row)
