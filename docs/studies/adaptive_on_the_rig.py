"""The bias that `adaptive` finds and its velocity error against (9), (10), (11): 100 seeds, no push.

Run it (about two minutes on a quiet core): python docs/studies/adaptive_on_the_rig.py
"""

import numpy as np

from cmg_mj import markdown
from cmg_mj.intervals import mean_interval
from cmg_mj.papers.dao2023.adaptive_rig import bias_errors, signed_biases, velocity_errors

SEED, WORLDS = 70_000, 100
BIASES_DEG = (0.5, 1.0, 1.5)
OTHERS = ("linear", "ltv", "homogeneous")

found = bias_errors(SEED, signed_biases(SEED, WORLDS))
print(f"e between 0.3 and 1.5 deg, either sign, {WORLDS} seeds: RMS error of the bias over seconds 5 to 10:")
print(f"mean {found.mean():.4f}, largest {found.max():.4f} deg; at most 0.15 deg in {np.mean(found <= 0.15):.0%}\n")

errors = velocity_errors(SEED, WORLDS, ("adaptive", *OTHERS), BIASES_DEG)
headings = ("e [deg]", *(f"`{name}` [1e-3 rad/s]" for name in errors), "worlds in which adaptive is least")
rows = []
for i, bias in enumerate(BIASES_DEG):
    intervals = [mean_interval(1e3 * values[i]) for values in errors.values()]
    cells = [f"{interval.mean:.1f} ± {interval.half:.1f}" for interval in intervals]
    least = min(np.mean(errors["adaptive"][i] < errors[name][i]) for name in OTHERS)
    rows.append((f"{bias:g}", *cells, f"{least:.0%}"))
print(markdown.table(headings, rows))
