"""A sweep from Python: every bias with every observer, and in how many worlds each stood."""

from __future__ import annotations

import cmg_mj

scenario = cmg_mj.load_scenario("push_recovery", ["duration_s=5.0"])
biases = {"plant.equilibrium_bias_deg": [0.0, 1.0, 2.0]}
found = cmg_mj.sweep(scenario, biases, ["linear", "homogeneous", "gyro_free"], worlds=5)

print(f"{found.trials.num_rows} trials, {found.cells.num_rows} cells")
for trial in found.trials.select(["plant.equilibrium_bias_deg", "observer", "world", "outcome"]).to_pylist()[:3]:
    print(" ", trial)
table = found.trials.group_by(["plant.equilibrium_bias_deg", "observer"]).aggregate([("stood", "sum")])
for row in table.sort_by([("observer", "ascending"), ("plant.equilibrium_bias_deg", "ascending")]).to_pylist():
    print(f"{row['observer']} at e = {row['plant.equilibrium_bias_deg']} deg: {row['stood_sum']} of 5 stood")
