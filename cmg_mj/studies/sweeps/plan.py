"""The cost of a sweep, estimated from pieces of it that are begun."""

from __future__ import annotations

import time
from dataclasses import replace

from cmg_mj.simulation.batch import can_vary_in_batch
from cmg_mj.studies.sweeps.chunk import compute
from cmg_mj.studies.sweeps.study import CHUNK, MOST_TRIALS, Chunk, SweepStudy

TRIALS, SECONDS, STRETCHES = 256, 1.5, 8
"""Trials that stand for a chunk, how long they run once they have begun [s], and in how many places."""
POINTS = 4096
"""Points that stand for all of a study beyond `MOST_TRIALS`."""
MB_AT_LEAST, MB_A_WORLD, MB_A_WORLD_S, MB_A_POINT, BYTES_A_TRIAL = 230.0, 0.015, 0.008, 0.12, 200.0
"""Memory of the process with its pictures; of a chunk's trials, their seconds, and its points; of every trial.

By the peaks (VmHWM) of four sweeps on Linux: of 0.05 s, 2 points x 50 worlds, 1,000 x 100, 5,000 x 1: 232, 252 and
372 MB; of 15 s, 1 x 1,024: 365 MB.
"""


def estimate_cost(study: SweepStudy) -> dict[str, float]:
    """Estimate minutes on this machine and memory, as far as a piece of every observer can say.

    Returns:
        The figures that `--dry-run --json` prints.
    """
    thinned = _thinned(study)
    seconds = sum(_seconds_a_trial(thinned, observer) for observer in study.observers)
    trials_an_observer = study.n_points * study.worlds
    trials_a_chunk = min(CHUNK, trials_an_observer)
    plants = min(study.n_points, -(-trials_a_chunk // study.worlds))
    return {
        "points": study.n_points,
        "observers": len(study.observers),
        "worlds": study.worlds,
        "trials": study.trials,
        "chunks": study.chunks.count,
        "minutes": seconds * trials_an_observer / 60.0,
        "memory_mb": MB_AT_LEAST
        + (MB_A_WORLD + MB_A_WORLD_S * study.scenario.duration_s) * trials_a_chunk
        + MB_A_POINT * plants
        + BYTES_A_TRIAL * study.trials / 2**20,
    }


def _thinned(study: SweepStudy) -> SweepStudy:
    """Thin a very large study, whose points would take long to draw and much memory, to points that lie alike."""
    if study.trials <= MOST_TRIALS or study.n_points <= POINTS:
        return study
    return replace(study, design="sample", n=POINTS)


def _seconds_a_trial(study: SweepStudy, observer: str) -> float:
    """Time some of an observer's trials, in several stretches if not all can run in one batch [s]."""
    trials = study.n_points * study.worlds
    pooled = all(
        can_vary_in_batch(field, study.scenario.controller.kind) for axis in study.axes for field in axis.fields
    )
    stretches = 1 if pooled else min(STRETCHES, trials)
    count = min(TRIALS, trials // stretches)
    starts = [trials * i // stretches for i in range(stretches)]
    seconds = [_seconds(study, Chunk(0, observer, study.chunks.stretch(first, count))) for first in starts]
    return sum(seconds) / len(seconds) / count


def _seconds(study: SweepStudy, piece: Chunk) -> float:
    """Time a piece by its preparation and by its pace once it has begun [s]."""
    begun: list[tuple[float, float]] = []
    enough = False

    def tick(share: float) -> None:
        nonlocal enough
        now = time.perf_counter()
        begun.append((now, share))
        if now - begun[0][0] > SECONDS:
            enough = True
            raise KeyboardInterrupt

    start = time.perf_counter()
    try:
        compute(study, piece, tick)
    except KeyboardInterrupt:
        if not enough:  # Ctrl-C
            raise
        (first, at), (last, to) = begun[0], begun[-1]
        return first - start + (last - first) / (to - at)
    return time.perf_counter() - start
