"""At which equilibrium bias e does each observer let the rig fall? Both signs, with and without the push.

For every seed and sign, the range of e is cut into eight twice, until the limit is known to 1/16 degree. A fall within
the scenario's 15 s counts.
True feedback (the exact rate in the law) and the gyro stand beside the observers.

    python docs/studies/bias_limits.py            # about three minutes on two quiet cores
"""

import dataclasses

import numpy as np

from cmg_mj.experiment import prepare
from cmg_mj.observers import OBSERVERS
from cmg_mj.plant import load_plant
from cmg_mj.scenario import load_scenario

SEED, WORLDS, LARGEST_DEG, CUTS, PARTS = 30_000, 5, 4.0, 2, 8


def limits(overrides: list[str], observer: str) -> np.ndarray:
    """Largest e at which a world stands, (2, WORLDS) for the signs - and + [deg]; negative if it falls at 0."""
    experiment = prepare(load_scenario("push_recovery", [f"seed={SEED}", *overrides]).with_observer(observer))
    signs = np.repeat([-1.0, 1.0], WORLDS)
    low, width = np.zeros(len(signs)), LARGEST_DEG
    for cut in range(CUTS):
        # In the first cut, e = 0 itself is tried too: a world may fall without any bias.
        parts = np.arange(1 if cut else 0, PARTS) * width / PARTS
        tried = low[:, None] + parts
        plants = [
            load_plant(dataclasses.replace(experiment.scenario.plant, equilibrium_bias_deg=float(sign * e)))
            for sign, row in zip(signs, tried, strict=True)
            for e in row
        ]
        numbers = [i % WORLDS for i in range(len(signs)) for _ in parts]
        result = experiment.run_many(numbers, plants=plants, keep_trajectory=False)
        stands = np.array([outcome.kind == "done" for outcome in result.outcomes]).reshape(tried.shape)
        first_fall = np.where(stands.all(axis=1), len(parts), np.argmin(stands, axis=1))
        standing = np.column_stack([low if cut else np.full(len(signs), -1.0), tried])
        low, width = standing[np.arange(len(signs)), first_fall], width / PARTS
        low = np.where(low < 0.0, -LARGEST_DEG, low)
    return low.reshape(2, WORLDS)


def cell(values: np.ndarray) -> str:
    """Median and range over the seeds."""
    if values.max() < 0.0:
        return "falls at 0"
    low, middle, high = max(values.min(), 0.0), max(np.median(values), 0.0), values.max()
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


cases = [(f"`{name}`", [], name) for name in OBSERVERS]
cases += [("gyro feedback", ['controller.feedback="fog"'], "homogeneous")]
cases += [("true feedback", ['controller.feedback="truth"'], "homogeneous")]
print("| in the loop | e < 0, push | e > 0, push | e < 0, no push | e > 0, no push |\n|---|---:|---:|---:|---:|")
for label, overrides, observer in cases:
    pushed, quiet = (limits([*overrides, *more], observer) for more in ([], ["push=[]"]))
    print(f"| {label} | " + " | ".join(cell(v) for v in (*pushed, *quiet)) + " |", flush=True)
