"""Every observer on the same motion: open loop, the law fed by the gyro (scenario observer_tuning, Fig. 4).

python docs/studies/ride_along.py
"""

import statistics

from cmg_mj.experiment import prepare
from cmg_mj.observers import OBSERVERS
from cmg_mj.scenario import load_scenario

result = prepare(load_scenario("observer_tuning", ["seed=60000"])).run_many(20, keep_trajectory=False)
print("| observer | velocity RMS error [rad/s] | standard deviation over worlds |\n|---|---:|---:|")
figures = []
for name in OBSERVERS:
    parts = [summary["companions"].get(name, summary) for summary in result.summaries]
    values = [part["velocity_rms_error_rad_s"] for part in parts]
    figures.append((statistics.fmean(values), statistics.stdev(values), name))
for mean, deviation, name in sorted(figures):
    print(f"| `{name}` | {mean:.4f} | {deviation:.4f} |")
