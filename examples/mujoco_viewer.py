"""A loop of your own in MuJoCo's viewer (macOS: mjpython): space pushes the rig; --headless pushes it at 1 s."""

from __future__ import annotations

import math
import sys
import time
from contextlib import nullcontext

import mujoco
import mujoco.viewer

import cmg_mj

rig = cmg_mj.load_plant(model="scissored_pair.xml")
controller, data = cmg_mj.controller(rig, "homogeneous"), rig.new_data()
pushed_at = [-1.0]


def on_key(key: int) -> None:
    """The viewer calls it, from a thread of its own."""
    if key == ord(" "):
        pushed_at[0] = data.time


headless, start = "--headless" in sys.argv, time.monotonic()
with nullcontext() if headless else mujoco.viewer.launch_passive(rig.model, data, key_callback=on_key) as viewer:
    while viewer.is_running() if viewer else data.time < 4.0:
        if headless and pushed_at[0] < 0.0 and data.time > 1.0:
            on_key(ord(" "))
        data.qfrc_applied[rig.tilt] = 2.0 if data.time < pushed_at[0] + 0.1 else 0.0  # N m, for 0.1 s
        cmg_mj.control(rig, controller, data)
        mujoco.mj_step(rig.model, data)
        if viewer:
            viewer.sync()
            time.sleep(max(0.0, start + data.time - time.monotonic()))
tilt = math.degrees(data.qpos[rig.tilt] - rig.tilt_zero)
print(f"pushed at {pushed_at[0]:.2f} s; at {data.time:.2f} s the tilt is {tilt:+.2f} deg")
