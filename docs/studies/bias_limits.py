"""At which equilibrium bias e does each observer let the rig fall? Both signs, with and without the push.

For every seed and sign, the range of e is cut into eight twice, until the limit is known to 1/16 degree. A fall within
the scenario's 15 s counts.
True feedback (the exact rate in the law) and the gyro stand beside the observers.

Run it (about a minute on two quiet cores): python docs/studies/bias_limits.py
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj import load_scenario, prepare
from cmg_mj.observers import OBSERVERS
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.side_by_side import BatchJob, run_jobs

SEED, WORLDS, MAX_BIAS_DEG, CUTS, PARTS = 30_000, 5, 4.0, 2, 8


class Case(NamedTuple):
    """An observer and the settings with which it closes the loop."""

    observer: str
    overrides: Sequence[str] = ()


def limits(cases: Sequence[Case]) -> list[np.ndarray]:
    """Largest e at which a world stands, (2, WORLDS) a case, for the signs - and + [deg]; negative if it falls at 0."""
    experiments = [prepare(load_scenario("push_recovery", [f"seed={SEED}", *more], name)) for name, more in cases]
    signs = np.repeat([-1.0, 1.0], WORLDS)
    lows, width = [np.zeros(len(signs)) for _ in cases], MAX_BIAS_DEG
    for cut in range(CUTS):
        # In the first cut, e = 0 itself is tried too: a world may fall without any bias.
        parts = np.arange(1 if cut else 0, PARTS) * width / PARTS
        worlds = np.repeat(np.arange(len(signs)) % WORLDS, len(parts)).tolist()
        tried = [low[:, None] + parts for low in lows]
        runs = [
            BatchJob(experiment.with_varied({"equilibrium_bias_deg": (signs[:, None] * of).ravel()}), worlds)
            for experiment, of in zip(experiments, tried, strict=True)
        ]
        for i, result in enumerate(run_jobs(runs, keep_trajectory=False)):
            stands = result.stood.reshape(tried[i].shape)
            first_fall = np.where(stands.all(axis=1), len(parts), np.argmin(stands, axis=1))
            standing = np.column_stack([lows[i] if cut else np.full(len(signs), -1.0), tried[i]])
            low = standing[np.arange(len(signs)), first_fall]
            lows[i] = np.where(low < 0.0, -MAX_BIAS_DEG, low)
        width /= PARTS
    return [low.reshape(2, WORLDS) for low in lows]


def cell(values: np.ndarray) -> str:
    """Median and range over the seeds."""
    if values.max() < 0.0:
        return "falls at 0"
    low, middle, high = max(values.min(), 0.0), max(np.median(values), 0.0), values.max()
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


def main() -> None:
    """Print the table of docs/results.md."""
    cases = {f"`{name}`": Case(name) for name in OBSERVERS}
    cases["gyro feedback"] = Case("homogeneous", ['controller.feedback="fog"'])
    cases["true feedback"] = Case("homogeneous", ['controller.feedback="truth"'])
    pushed = limits(list(cases.values()))
    quiet = limits([Case(name, [*more, "push=[]"]) for name, more in cases.values()])
    rows = [
        (label, *(cell(values) for values in (*with_push, *without)))
        for label, with_push, without in zip(cases, pushed, quiet, strict=True)
    ]
    print(markdown_table(("in the loop", "e < 0, push", "e > 0, push", "e < 0, no push", "e > 0, no push"), rows))


if __name__ == "__main__":
    main()
