"""Where the paper's order of the velocity RMS errors holds, over accelerometer noise and equilibrium bias.

Each cell: the mean velocity RMS error [1e-3 rad/s] of homogeneous (H), ltv (V) and linear (L) over the worlds that
stood, and their order; worlds are the same for all three. "~" joins two whose difference, world by world, is within
two standard errors. A number in brackets is the share of falls.

    python docs/studies/noise_bias_map.py         # about three minutes on two quiet cores
"""

import dataclasses
import math
import statistics

from cmg_mj.experiment import prepare
from cmg_mj.plant import load_plant
from cmg_mj.scenario import load_scenario

SEED, WORLDS = 40_000, 20
NOISE_UG = (0, 100, 200, 400, 800)
BIAS_DEG = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5)
LETTERS = {"homogeneous": "H", "ltv": "V", "linear": "L"}


def errors(observer: str, noise: float) -> dict[float, list[float | None]]:
    """Bias -> velocity RMS error of every world, None where it fell [rad/s]."""
    settings = [f"seed={SEED}", f"sensors.accelerometer.noise_density_ug_rthz={noise}"]
    experiment = prepare(load_scenario("push_recovery", settings).with_observer(observer))
    rigs = [load_plant(dataclasses.replace(experiment.scenario.plant, equilibrium_bias_deg=bias)) for bias in BIAS_DEG]
    plants = [rig for rig in rigs for _ in range(WORLDS)]
    result = experiment.run_many([*range(WORLDS)] * len(rigs), plants=plants, keep_trajectory=False)
    values = [
        summary["velocity_rms_error_rad_s"] if outcome.kind == "done" else None
        for summary, outcome in zip(result.summaries, result.outcomes, strict=True)
    ]
    return {bias: values[i * WORLDS : (i + 1) * WORLDS] for i, bias in enumerate(BIAS_DEG)}


def relation(a: list[float | None], b: list[float | None]) -> str:
    """ "<" where a is smaller than b world by world by more than two standard errors, else "~"."""
    pairs = [(x, y) for x, y in zip(a, b, strict=True) if x is not None and y is not None]
    if len(pairs) < 2:
        return "<"
    differences = [y - x for x, y in pairs]
    error = statistics.stdev(differences) / math.sqrt(len(differences))
    return "<" if statistics.fmean(differences) > 2.0 * error else "~"


def cell(found: dict[str, list[float | None]]) -> str:
    """Errors and order at one point of the map."""
    stood = {name: [v for v in values if v is not None] for name, values in found.items()}
    means = {name: statistics.fmean(values) if values else math.inf for name, values in stood.items()}
    first, second, third = sorted(means, key=lambda name: means[name])
    order = LETTERS[first] + relation(found[first], found[second]) + LETTERS[second]
    order += relation(found[second], found[third]) + LETTERS[third]
    numbers = []
    for name in LETTERS:
        falls = 1.0 - len(stood[name]) / WORLDS
        shown = "-" if math.isinf(means[name]) else f"{1e3 * means[name]:.0f}"
        numbers.append(shown + (f" [{falls:.0%}]" if falls else ""))
    return f"**{order}** {' / '.join(numbers)}"


print("| noise [ug/rtHz] | " + " | ".join(f"e = {bias:g} deg" for bias in BIAS_DEG) + " |")
print("|---|" + "---|" * len(BIAS_DEG))
for noise in NOISE_UG:
    row = {name: errors(name, noise) for name in LETTERS}
    cells = [cell({name: found[bias] for name, found in row.items()}) for bias in BIAS_DEG]
    print(f"| {noise} | " + " | ".join(cells) + " |", flush=True)
