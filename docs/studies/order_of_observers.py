"""At how many points of a sweep an order of observers holds, the best first; what decides the first two's ratio.

    python docs/studies/order_of_observers.py runs/sweep-plausible_rigs homogeneous ltv linear

By the means over a point's worlds; a fall is worse than any error. A point with a refused or stopped trial, or where
two neighbours fell, does not count. Intervals are Wilson's. Of a design for Sobol indices: total indices of the
logarithm of the ratio of the first two.
"""

from __future__ import annotations

import math
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cmg_mj.features.sweeps.cells import fell_interval
from cmg_mj.features.sweeps.sobol import indices

FIGURES = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s", "tilt_rms_deg")


def main(folder: Path, order: list[str]) -> None:
    """Print both."""
    trials: Any = pd.read_parquet(folder / "trials.parquet")
    study = tomllib.loads((folder / "study.toml").read_text(encoding="utf-8"))
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
        ratio = (errors[order[0]] / errors[order[1]]).map(math.log).groupby("point").mean().to_numpy()
        if study["sweep"]["design"] == "sobol" and np.isfinite(ratio).all():
            result = indices(ratio, study["sweep"]["n"], study["scenario"]["seed"])
            for field, *total in zip(study["vary"], result.total, result.total_low, result.total_high, strict=True):
                print("  {}: {:.3f} ({:.3f} to {:.3f})".format(field, *total))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
