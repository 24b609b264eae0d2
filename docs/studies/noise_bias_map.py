"""Where the paper's order of the velocity RMS errors holds, over accelerometer noise and equilibrium bias.

Each cell: the mean velocity RMS error [1e-3 rad/s] of homogeneous (H), ltv (V) and linear (L) over the worlds that
stood, and their order; worlds are the same for all three. "~" joins two whose difference, world by world, is within
two standard errors. A number in brackets is the share of falls.

Run it (about three minutes on two quiet cores): python docs/studies/noise_bias_map.py
"""

import math

import numpy as np

from cmg_mj import load_scenario, markdown, prepare

SEED, WORLDS = 40_000, 20
NOISE_UG = (0, 100, 200, 400, 800)
BIAS_DEG = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5)
LETTERS = {"homogeneous": "H", "ltv": "V", "linear": "L"}


def errors(observer: str, noise: float) -> dict[float, np.ndarray]:
    """Bias -> velocity RMS error of every world, (WORLDS,) [rad/s]; NaN where it fell."""
    settings = [f"seed={SEED}", f"sensors.accelerometer.noise_density_ug_rthz={noise}"]
    experiment = prepare(load_scenario("push_recovery", settings, observer))
    vary = {"equilibrium_bias_deg": [bias for bias in BIAS_DEG for _ in range(WORLDS)]}
    result = experiment.run_many([*range(WORLDS)] * len(BIAS_DEG), vary=vary, keep_trajectory=False)
    groups = result.groups(len(BIAS_DEG))
    return {bias: group.values("velocity_rms_error_rad_s") for bias, group in zip(BIAS_DEG, groups, strict=True)}


def mean(values: np.ndarray) -> float:
    """Over the worlds that stood [rad/s]; infinite if none did."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.inf


def relation(a: np.ndarray, b: np.ndarray) -> str:
    """ "<" where a is smaller than b world by world by more than two standard errors, else "~"."""
    differences = (b - a)[np.isfinite(b - a)]
    if len(differences) < 2:
        return "<"
    error = differences.std(ddof=1) / math.sqrt(len(differences))
    return "<" if differences.mean() > 2.0 * error else "~"


def cell(found: dict[str, np.ndarray]) -> str:
    """Errors and order at one point of the map."""
    means = {name: mean(values) for name, values in found.items()}
    first, second, third = sorted(means, key=lambda name: means[name])
    order = LETTERS[first] + relation(found[first], found[second]) + LETTERS[second]
    order += relation(found[second], found[third]) + LETTERS[third]
    numbers = []
    for name in LETTERS:
        falls = np.isnan(found[name]).mean()
        shown = "-" if math.isinf(means[name]) else f"{1e3 * means[name]:.0f}"
        numbers.append(shown + (f" [{falls:.0%}]" if falls else ""))
    return f"**{order}** {' / '.join(numbers)}"


rows = []
for noise in NOISE_UG:
    row = {name: errors(name, noise) for name in LETTERS}
    cells = [cell({name: found[bias] for name, found in row.items()}) for bias in BIAS_DEG]
    rows.append((f"{noise}", *cells))
headings = ("noise [ug/rtHz]", *(f"e = {bias:g} deg" for bias in BIAS_DEG))
print(markdown.table(headings, rows, text_columns=len(headings)))
