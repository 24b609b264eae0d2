"""An observer's parameter fitted to the gyro on some worlds and scored on others, then run with what was found."""

from __future__ import annotations

import cmg_mj
from cmg_mj.features.tuning import tune, tuned_scenario

scenario = cmg_mj.load_scenario("observer_tuning", ["open_loop_observers=[]"], observer="linear")
study = tune(scenario, worlds=5, parameters=["tau"], noise_ug_rthz=[400.0])
(level,) = study.levels
print(f"tau: {study.start_parameters['tau']} s given, {level.sizes['tau']:.4f} s tuned")
ratio = level.ratio
print(f"held-out error, given by tuned: {ratio.mean:.3f} ({ratio.low:.3f} to {ratio.high:.3f}): {level.verdict}")

result = cmg_mj.prepare(tuned_scenario(study, level)).run()
print(f"one run with it: {result.summaries[0]['velocity_rms_error_rad_s']:.4f} rad/s")
