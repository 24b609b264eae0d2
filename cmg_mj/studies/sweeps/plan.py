"""What a sweep would take, from pieces of it that are begun."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from cmg_mj.simulation.batch import can_vary_in_batch
from cmg_mj.studies.sweeps.chunk import compute
from cmg_mj.studies.sweeps.study import CHUNK, MOST_TRIALS, Chunk, SweepStudy

TRIALS, SECONDS, STRETCHES = 256, 1.5, 8
"""So many trials stand for a chunk and are run for so long once they have begun, in so many places."""
POINTS = 4096
"""Of a study beyond `MOST_TRIALS` so many stand for all."""
MB_AT_LEAST, MB_A_WORLD, MB_A_WORLD_S, MB_A_POINT, BYTES_A_TRIAL = 230.0, 0.015, 0.008, 0.12, 200.0
"""Of the process with its pictures; of each of a chunk's trials and its seconds, and of its points; of all trials.

By the peaks (VmHWM) of four sweeps on Linux: of 0.05 s, 2 points x 50 worlds, 1,000 x 100, 5,000 x 1: 232, 252 and
372 MB; of 15 s, 1 x 1,024: 365 MB.
"""


def estimate_cost(study: SweepStudy) -> dict[str, Any]:
    """Points, trials, chunks; minutes on this machine and memory, as far as a piece of every observer can say."""
    looked_at = _thinned(study)
    seconds = sum(_seconds_a_trial(looked_at, observer) for observer in study.observers)
    of_an_observer = study.n_points * study.worlds
    of_a_chunk = min(CHUNK, of_an_observer)
    rigs = min(study.n_points, -(-of_a_chunk // study.worlds))
    return {
        "points": study.n_points,
        "observers": len(study.observers),
        "worlds": study.worlds,
        "trials": study.trials,
        "chunks": study.chunks.count,
        "minutes": seconds * of_an_observer / 60.0,
        "memory_mb": MB_AT_LEAST
        + (MB_A_WORLD + MB_A_WORLD_S * study.scenario.duration_s) * of_a_chunk
        + MB_A_POINT * rigs
        + BYTES_A_TRIAL * study.trials / 2**20,
    }


def _thinned(study: SweepStudy) -> SweepStudy:
    """The study, or of a very large one, whose points would take long to draw and much memory, some that lie alike."""
    if study.trials <= MOST_TRIALS or study.n_points <= POINTS:
        return study
    return replace(study, design="sample", n=POINTS)


def _seconds_a_trial(study: SweepStudy, observer: str) -> float:
    """Of an observer, by some of its trials; by several stretches of them if not all can run in one batch."""
    trials = study.n_points * study.worlds
    pooled = all(
        can_vary_in_batch(field, study.scenario.controller.kind) for axis in study.axes for field in axis.fields
    )
    stretches = 1 if pooled else min(STRETCHES, trials)
    count = min(TRIALS, trials // stretches)
    starts = [trials * i // stretches for i in range(stretches)]
    taken = [_seconds(study, Chunk(0, observer, study.chunks.stretch(first, count))) for first in starts]
    return sum(taken) / len(taken) / count


def _seconds(study: SweepStudy, piece: Chunk) -> float:
    """What a piece takes, by what makes it ready and by its pace once it has begun."""
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
