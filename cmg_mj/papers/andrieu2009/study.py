"""The simulations behind Figs 1 and 2: the bioreactor and its three observers, many seeds at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cmg_mj.papers.andrieu2009.bioreactor import Bioreactor
from cmg_mj.papers.andrieu2009.paper import HBAR, HBAR_OF_OBSERVERS, NOISE
from cmg_mj.papers.andrieu2009.simulation import (
    KINDS,
    Replay,
    Run,
    incremental_rate,
    replays,
    rms_late,
    run_plant,
    select_seeds,
)
from cmg_mj.papers.claim import Assumption

LOUD = 0.0986
"""10 % of the domain of eta1, which the paper takes for 0.05."""


class Study(NamedTuple):
    """All simulations of the bioreactor: columns are seeds."""

    run: Run
    nominal: dict[str, Replay]
    """Runs with the paper's noise and error of hbar."""
    loud: dict[str, Replay]
    """Runs with noise of 10 % of the domain."""
    quiet_run: Run
    quiet: dict[str, Replay]
    """Replays without noise, on one run."""
    exact: dict[str, Replay]
    """Runs with noise, without error of hbar."""
    rate: np.ndarray
    """df2/dx2, (n, seeds)."""


ASSUMED: Mapping[Assumption, str] = {
    "initial values": "drawn from M_eta for each seed",
    "noise": "a new value every 10 ms, straight in between",
}
"""Data of Figs 1 and 2 that the paper does not give."""


def study(seeds: int, seed: int = 0, dt: float = 0.01) -> Study:
    """Simulate. All noise levels are columns of the same arrays, which costs no time."""
    numbers = [*range(seed, seed + seeds)] * 2 + [seed]
    noise = [NOISE] * seeds + [LOUD] * seeds + [0.0]
    whole_run = run_plant(numbers, noise, dt)
    model = Bioreactor(HBAR_OF_OBSERVERS)
    whole_replays = replays(whole_run, model)
    first, second, last = slice(0, seeds), slice(seeds, 2 * seeds), slice(2 * seeds, None)
    run, quiet_run = select_seeds(whole_run, first), select_seeds(whole_run, last)

    def columns(selection: slice) -> dict[str, Replay]:
        return {kind: select_seeds(part, selection) for kind, part in whole_replays.items()}

    exact = replays(run, Bioreactor(HBAR))
    return Study(run, columns(first), columns(second), quiet_run, columns(last), exact, incremental_rate(run, model))


def rms_by_kind(run: Run, by_kind: dict[str, Replay]) -> np.ndarray:
    """Return the RMS error of eta2 after t = 5, (3 observers, seeds)."""
    return np.array([rms_late(run, by_kind[kind].eta2_error) for kind in KINDS])
