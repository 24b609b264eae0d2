"""At how many points of a sweep an order of observers holds, the best first.

    python docs/studies/order_of_observers.py runs/sweep-plausible_rigs homogeneous ltv linear

By the means over a point's worlds; a fall is worse than any error. A point with a refused or stopped trial, or where
two neighbours fell, does not count. Intervals are Wilson's.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cmg_mj.features.sweeps.cells import fell_interval

FIGURES = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s", "tilt_rms_deg")


def main(folder: Path, order: list[str]) -> None:
    """Print the shares of the points."""
    trials: Any = pd.read_parquet(folder / "trials.parquet")
    for figure in FIGURES:
        of_trials = trials.assign(error=trials[figure].where(trials["outcome"] != "fell", np.inf))
        errors = of_trials.pivot(index=["point", "world"], columns="observer", values="error")[order]
        means = errors.groupby("point").agg(lambda worlds: worlds.mean(skipna=False))
        known = means.dropna().to_numpy()
        better, worse = known[:, :-1], known[:, 1:]
        held = (better < worse).all(axis=1)
        decided = held | ((better >= worse) & np.isfinite(worse)).any(axis=1)
        if decided.any():
            share, low, high = fell_interval(int(held.sum()), int(decided.sum()))
            print(f"{figure}: {' < '.join(order)} at {held.sum()} of {decided.sum()} points", end=" ")
            print(f"({100 * share:.1f} %, {100 * low:.1f} to {100 * high:.1f})")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
