"""The equilibrium bias, found while the loop runs on the observer that finds it."""

from __future__ import annotations

import numpy as np

import cmg_mj

for bias in (-1.0, 0.5):
    experiment = cmg_mj.prepare(cmg_mj.load_scenario("bias_estimation", [f"plant.equilibrium_bias_deg={bias}"]))
    result = experiment.run()
    summary = result.summaries[0]
    found, error = summary["bias_estimate_deg"], summary["bias_rms_error_deg"]
    print(f"e = {bias:+.1f} deg: found {found:+.3f} deg, RMS error {error:.3f} deg")
    assert result.trajectory is not None
    trace = np.degrees(result.trajectory["estimate/adaptive/bias_rad"])
    for time in (0.25, 0.5, 1.0, 2.0):
        print(f"  after {time:4.2f} s: {trace[round(time * 200)]:+.2f} deg")
