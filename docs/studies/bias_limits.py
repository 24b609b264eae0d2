"""At which equilibrium bias e does each observer let the rig fall? Both signs, with and without the push.

For every seed and sign, e is bisected until the limit is known to 1/32 degree. A fall within the scenario's 15 s
counts.
True feedback (the exact rate in the law) and the gyro stand beside the observers.

    python docs/studies/bias_limits.py            # about three minutes on two quiet cores
"""

import dataclasses

import numpy as np

from cmg_mj.observers import OBSERVERS
from cmg_mj.plant import load_plant
from cmg_mj.scenario import load_scenario, prepare

SEED, WORLDS, LARGEST_DEG, HALVINGS = 30_000, 10, 4.0, 7


def limits(overrides: list[str], observer: str) -> np.ndarray:
    """Largest e at which a world stands, (2, WORLDS) for the signs - and + [deg]; LARGEST_DEG if it never falls."""
    experiment = prepare(load_scenario("push_recovery", [f"seed={SEED}", *overrides]).with_observer(observer))
    signs = np.repeat([-1.0, 1.0], WORLDS)
    low, high = np.full(len(signs), -LARGEST_DEG / 2**HALVINGS), np.full(len(signs), LARGEST_DEG)
    for _ in range(HALVINGS + 1):
        tried = np.maximum(0.5 * (low + high), 0.0)
        plants = [
            load_plant(dataclasses.replace(experiment.scenario.plant, equilibrium_bias_deg=float(s * e)))
            for s, e in zip(signs, tried, strict=True)
        ]
        numbers = [*range(WORLDS), *range(WORLDS)]
        result = experiment.run_many(numbers, plants=plants, keep_trajectory=False)
        stands = np.array([outcome.kind == "done" for outcome in result.outcomes])
        low, high = np.where(stands, tried, low), np.where(stands, high, tried)
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
