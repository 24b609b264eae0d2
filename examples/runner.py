"""A scenario from Python: one run with its trajectory, driven by the runner's loop and by MuJoCo's callback."""

from __future__ import annotations

import numpy as np

import cmg_mj

experiment = cmg_mj.prepare(cmg_mj.load_scenario("push_recovery", ["seed=3", "plant.equilibrium_bias_deg=1.0"]))
result = experiment.run()
again = experiment.run(driver="callback")
assert result.trajectory is not None
assert again.trajectory is not None

print(result.outcomes[0])
for name, value in result.summaries[0].items():
    if isinstance(value, float):
        print(f"  {name}: {value:.4g}")
for name in ("zero", "mems_as_bought", "mems_gyro", "mems_fused", "floor_y1", "floor_accel"):  # the baselines
    print(f"  error of {name}: {result.mean('velocity_rms_error_rad_s', name):.4g} rad/s")
error = result.trajectory["estimate/homogeneous/x2_rad_s"] - result.trajectory["x2_rad_s"]
print(f"largest velocity error: {np.abs(error).max():.3f} rad/s")
print(f"the callback's run is the same: {np.array_equal(again.trajectory['x2_rad_s'], result.trajectory['x2_rad_s'])}")
