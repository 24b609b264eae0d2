"""The controller in a MuJoCo loop of your own: it samples, estimates and decides when it is due."""

from __future__ import annotations

import math

import mujoco

import cmg_mj

rig = cmg_mj.load_plant(model="scissored_pair.xml", equilibrium_bias_deg=0.5)
controller = cmg_mj.controller(rig, {"kind": "homogeneous", "k1": 20.0}, seed=3)
data = rig.new_data()
while data.time < 5.0:
    cmg_mj.control(rig, controller, data)  # before every step
    mujoco.mj_step(rig.model, data)

tick = controller.tick
assert tick is not None
_, estimated_rate, _ = tick.estimates[0]
print(f"estimated tilt rate {estimated_rate:+.4f} rad/s, true one {data.qvel[rig.tilt]:+.4f} rad/s")
print(f"tilt {math.degrees(data.qpos[rig.tilt] - rig.tilt_zero):+.2f} deg, command {tick.u:+.3f} rad/s")
