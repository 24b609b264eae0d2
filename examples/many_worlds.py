"""Many worlds at once: means with 95 % intervals, a difference world by world, and a setting that varies."""

from __future__ import annotations

import cmg_mj
from cmg_mj.results.intervals import mean_interval, paired_verdict

WORLDS = 10
KEY = "velocity_rms_error_rad_s"

scenario = cmg_mj.load_scenario("push_recovery", ["duration_s=8.0"])
errors = {}
for kind in ("homogeneous", "ltv"):
    result = cmg_mj.prepare(scenario.with_observer(kind)).run_many(WORLDS, keep_trajectory=False)
    errors[kind] = result.values(KEY)
    mean, low, high = mean_interval(errors[kind])
    print(f"{kind}: {mean:.4f} rad/s, 95 % interval {low:.4f} to {high:.4f}")

# World i has the same noise for every observer, so that the difference is taken world by world.
difference = mean_interval(errors["ltv"] - errors["homogeneous"])
print(f"homogeneous beside ltv: {paired_verdict(difference)}, by {difference.mean:.4f} +- {difference.half:.4f} rad/s")

biases = [0.0, 0.75, 1.5]
vary = {"equilibrium_bias_deg": [bias for bias in biases for _ in range(4)]}
together = cmg_mj.prepare(scenario).run_many(4 * len(biases), settings=vary, keep_trajectory=False)
for bias, group in zip(biases, together.split(len(biases)), strict=True):
    print(f"e = {bias} deg: {group.fell.sum()} of 4 fell, gimbal peak {group.mean('gimbal_peak_deg')} deg")
