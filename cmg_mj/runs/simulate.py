"""Options of a run, and how its worlds end."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypedDict

from cmg_mj.core.loop import Ending
from cmg_mj.results.result import Outcome
from cmg_mj.results.trajectory import Trajectory

DIVERGED_TILT = 2.0 * math.pi
"""No plant that stood at one instant lies a whole turn farther at the next one: it has diverged [rad]."""
Since = Callable[[int], Trajectory]
"""Returns the ticks from one on, as far as the run has come."""


class SimulationOptions(TypedDict, total=False):
    """Options of a run that change no figure."""

    keep_trajectory: bool
    """True to keep every tick; if False, memory does not grow with the duration."""
    on_progress: Callable[[float], None] | None
    """Called after every tick with the simulated time [s]; a KeyboardInterrupt it raises ends the run."""
    on_start: Callable[[Since], None] | None
    """Called before the first tick with a function that shows the ticks meanwhile."""
    threads: int
    """Number of threads that step many worlds; 0: as many as there are processors."""


def outcome_of(ending: Ending, timestep: float) -> Outcome:
    """Say how a world ended that the loop stopped."""
    time = ending.step * timestep
    if ending.message:
        return Outcome("stopped", time, f"{ending.message} at t = {time:g} s")
    if abs(ending.tilt) < DIVERGED_TILT:
        return Outcome("fell", time)
    return Outcome(
        "stopped",
        time,
        f"the plant diverged at t = {time:g} s: take a smaller plant.timestep_s, the integrator RK4 or a gentler push",
    )
