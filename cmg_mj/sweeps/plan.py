"""What a sweep would take, from pieces of it that are begun."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

from cmg_mj.sweeps.study import CHUNK, Chunk, Study
from cmg_mj.sweeps.work import compute

TRIALS, SECONDS = 256, 1.5
"""Of each observer's piece: so many trials stand for a chunk, and are run for so long once they have begun."""
MB_AT_LEAST, MB_A_WORLD, MB_A_WORLD_S, MB_A_POINT, BYTES_A_TRIAL = 230.0, 0.015, 0.008, 0.12, 200.0
"""Of the process with its pictures; of each of a chunk's trials and its seconds, and of its points; of all trials.

By the peaks (VmHWM) of four sweeps on Linux: of 0.05 s, 2 points x 50 worlds, 1,000 x 100, 5,000 x 1: 232, 252 and
372 MB; of 15 s, 1 x 1,024: 365 MB.
"""


class _Enough(KeyboardInterrupt):
    """A piece has been run for long enough."""


def expected(study: Study) -> dict[str, Any]:
    """Points, trials, chunks; minutes on this machine and memory, as far as a piece of every observer can say."""
    seconds = sum(_seconds_a_trial(study, place) for place in range(len(study.observers)))
    of_a_chunk = min(CHUNK, len(study.points) * study.worlds)
    rigs = min(len(study.points), -(-of_a_chunk // study.worlds))
    return {
        "points": len(study.points),
        "observers": len(study.observers),
        "worlds": study.worlds,
        "trials": study.trials,
        "chunks": len(study.chunks),
        "minutes": seconds * len(study.points) * study.worlds / 60.0,
        "memory_mb": MB_AT_LEAST
        + (MB_A_WORLD + MB_A_WORLD_S * study.scenario.duration_s) * of_a_chunk
        + MB_A_POINT * rigs
        + BYTES_A_TRIAL * study.trials / 2**20,
    }


def _seconds_a_trial(study: Study, place: int) -> float:
    """Of an observer, by the first trials of its middle chunk: what it takes to make them ready, and their pace."""
    chunks = study.chunks
    of_one = len(chunks) // len(study.observers)
    whole: Chunk = chunks[place * of_one + of_one // 2]
    piece = dataclasses.replace(whole, trials=whole.trials[:TRIALS])
    start = time.perf_counter()
    begun: list[tuple[float, float]] = []

    def tick(share: float) -> None:
        now = time.perf_counter()
        begun.append((now, share))
        if now - begun[0][0] > SECONDS:
            raise _Enough

    try:
        compute(study, piece, tick)
        taken = time.perf_counter() - start
    except KeyboardInterrupt:
        (first, at), (last, to) = begun[0], begun[-1]
        if last - first <= SECONDS:  # Ctrl-C
            raise
        taken = first - start + (last - first) / (to - at)
    return taken / len(piece.trials)
