"""The controller as MuJoCo's control callback: whatever steps the model, with any integrator, is controlled."""

from __future__ import annotations

import math

import mujoco

import cmg_mj

for integrator in ("RK4", "implicitfast"):
    rig = cmg_mj.load_plant(model="scissored_pair.xml", integrator=integrator)
    data = rig.new_data()
    with cmg_mj.control_callback(rig, cmg_mj.controller(rig, "ltv")):  # taken out again even on an exception
        mujoco.mj_step(rig.model, data, round(5.0 / rig.timestep))
    tilt = math.degrees(data.qpos[rig.tilt] - rig.tilt_zero)
    print(f"{integrator}: after {data.time:.1f} s the tilt is {tilt:+.2f} deg")
