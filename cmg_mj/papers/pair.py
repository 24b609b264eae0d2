"""The experiments on the scissored pair of six bodies: one way to set them up, and what is read off their runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from cmg_mj.features.replay import replay
from cmg_mj.observers import Estimate, Observer
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.plant.plant import Plant
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.runs.side_by_side import run_jobs, run_of
from cmg_mj.scenario.loading import load_scenario

DT = 0.005
"""The bench's control period [s]; the paper does not give its own."""
DURATION_S = 10.0
"""Duration of the runs that Figs 5 to 7 and their variations are made of [s]."""
PUSH_RECOVERY = {"push": "1 N m for 0.1 s", "e": "0.5 deg", "noise": "400 ug/rtHz"}
"""The push, e and the noise that the papers do not give: those of push_recovery and observer_tuning."""
SEED_OF_10 = 71_000
"""Seed of the run with (10) in the loop that several sections replay."""


def push_recovery(observer: str, seed: int, settings: Sequence[str] = (), duration_s: float = DURATION_S) -> Experiment:
    """Prepare Figs 5 to 7: an observer's estimate in the law, and a push of 1 N m for 0.1 s at 2 s.

    Args:
        observer: Its name.
        seed: Seed of the noise.
        settings: Settings `section.field=value` that differ.
        duration_s: Simulated time [s].

    Returns:
        The experiment, ready to run.
    """
    common = [f"seed={seed}", f"duration_s={duration_s}", "open_loop_observers=[]"]
    return prepare(load_scenario("push_recovery", [*common, *settings], observer))


def run_loops(
    cases: Mapping[Any, tuple[str, Sequence[str]]],
    worlds: int,
    seed: int,
    duration_s: float = DURATION_S,
    keep_trajectory: bool = True,
) -> dict[Any, Result]:
    """Run `push_recovery` with observers and their settings, all at once: case -> result."""
    jobs = [run_of(push_recovery(name, seed, settings, duration_s), worlds) for name, settings in cases.values()]
    return dict(zip(cases, run_jobs(jobs, keep_trajectory=keep_trajectory), strict=True))


@cache
def run_of_10(seed: int) -> Trajectory:
    """Six seconds of one world with (10) in the loop, which its forms are replayed on."""
    return trajectory_of(push_recovery("ltv", seed, duration_s=6.0).run())


def run_on_rigs(experiment: Experiment, rigs: Sequence[Plant], worlds: int) -> list[Result]:
    """Run the same worlds on every rig, all in one batch; a result a rig."""
    plants = [rig for rig in rigs for _ in range(worlds)]
    return experiment.run_many([*range(worlds)] * len(rigs), plants=plants).split(len(rigs))


def replay_at_rest(observer: Observer, y1: np.ndarray) -> Estimate:
    """Replay an observer on measured tilts, (n_ticks, n_worlds) [rad], with the gimbals at rest: y2 = u = 0."""
    zeros = np.zeros_like(y1)
    return replay(observer, Trajectory({"y1_rad": y1, "y2_rad": zeros, "u_rad_s": zeros}))
