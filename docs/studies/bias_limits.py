"""At which equilibrium bias e does each observer let the rig fall? Both signs, with and without the push.

For every seed and sign, the range of e is cut into eight twice, until the limit is known to 1/16 degree. A fall within
the scenario's 15 s counts.
True feedback (the exact rate in the law) and the gyro stand beside the observers.

Run it (about three minutes on two quiet cores): python docs/studies/bias_limits.py
"""

import numpy as np

from cmg_mj import load_scenario, markdown, prepare
from cmg_mj.observers import OBSERVERS

SEED, WORLDS, LARGEST_DEG, CUTS, PARTS = 30_000, 5, 4.0, 2, 8


def limits(overrides: list[str], observer: str) -> np.ndarray:
    """Largest e at which a world stands, (2, WORLDS) for the signs - and + [deg]; negative if it falls at 0."""
    experiment = prepare(load_scenario("push_recovery", [f"seed={SEED}", *overrides], observer))
    signs = np.repeat([-1.0, 1.0], WORLDS)
    low, width = np.zeros(len(signs)), LARGEST_DEG
    for cut in range(CUTS):
        # In the first cut, e = 0 itself is tried too: a world may fall without any bias.
        parts = np.arange(1 if cut else 0, PARTS) * width / PARTS
        tried = low[:, None] + parts
        biases = (signs[:, None] * tried).ravel().tolist()
        worlds = np.repeat(np.arange(len(signs)) % WORLDS, len(parts)).tolist()
        result = experiment.run_many(worlds, vary={"equilibrium_bias_deg": biases}, keep_trajectory=False)
        stands = result.stood.reshape(tried.shape)
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


def main() -> None:
    """Print the table of docs/results.md."""
    cases = [(f"`{name}`", [], name) for name in OBSERVERS]
    cases += [("gyro feedback", ['controller.feedback="fog"'], "homogeneous")]
    cases += [("true feedback", ['controller.feedback="truth"'], "homogeneous")]
    rows = []
    for label, overrides, observer in cases:
        pushed, quiet = (limits([*overrides, *more], observer) for more in ([], ["push=[]"]))
        rows.append((label, *(cell(values) for values in (*pushed, *quiet))))
    print(markdown.table(("in the loop", "e < 0, push", "e > 0, push", "e < 0, no push", "e > 0, no push"), rows))


if __name__ == "__main__":
    main()
