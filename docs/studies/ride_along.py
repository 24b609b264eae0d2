"""Every observer on the same motion: open loop, the law fed by the gyro (scenario observer_tuning, Fig. 4).

Run it (a few seconds): python docs/studies/ride_along.py
"""

from cmg_mj import load_scenario, markdown, prepare
from cmg_mj.observers import OBSERVERS
from cmg_mj.summary_keys import heading, written

SEED, WORLDS = 60_000, 20
ERROR = "velocity_rms_error_rad_s"

experiment = prepare(load_scenario("observer_tuning", [f"seed={SEED}"]))
result = experiment.run_many(WORLDS, keep_trajectory=False)
in_the_loop, *riding = experiment.observer_names
errors = {in_the_loop: result.values(ERROR)} | {name: result.values(ERROR, name) for name in riding}
figures = sorted((errors[name].mean(), errors[name].std(ddof=1), name) for name in OBSERVERS)
rows = [(f"`{name}`", written(ERROR, mean), written(ERROR, deviation)) for mean, deviation, name in figures]
print(markdown.table(("observer", heading(ERROR), "standard deviation over worlds"), rows))
