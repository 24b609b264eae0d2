"""What a sweep would take, from a piece of it."""

from __future__ import annotations

import time
from typing import Any

from cmg_mj.experiment import prepare
from cmg_mj.sweeps.study import CHUNK, Study

WORLDS, SECONDS = 128, 0.5
"""Of the piece that is timed, for every observer."""
MB_A_WORLD, MB_AT_LEAST = 0.11, 90.0
"""Of one chunk, measured with 256 and 1,024 worlds."""


def expected(study: Study) -> dict[str, Any]:
    """Points, trials, chunks; minutes and memory, as far as a piece of half a second can say."""
    seconds = 0.0
    scenario = study.scenario.model_copy(update={"companions": [], "push": []})
    duration = min(SECONDS, scenario.duration_s)
    for observer in study.observers:
        piece = prepare(scenario.with_observer(observer).model_copy(update={"duration_s": duration}))
        start = time.perf_counter()
        piece.run_many(min(WORLDS, study.trials), keep_trajectory=False)
        each = (time.perf_counter() - start) / (min(WORLDS, study.trials) * duration)
        seconds += each * study.scenario.duration_s * study.trials / len(study.observers)
    return {
        "points": len(study.points),
        "observers": len(study.observers),
        "worlds": study.worlds,
        "trials": study.trials,
        "chunks": len(study.chunks),
        "minutes": seconds / 60.0,
        "memory_mb": MB_AT_LEAST + MB_A_WORLD * min(CHUNK, study.trials),
    }
