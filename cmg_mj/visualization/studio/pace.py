"""How far the simulation should be by the clock: real time, or a share of it."""

from __future__ import annotations

from collections.abc import Callable

MOST_BEHIND_S = 0.1
"""What a simulation falls behind beyond this is given up: it does not run to catch up [s]."""
MEASURED_OVER_S = 0.5
"""[s]"""


class StepScheduler:
    """Simulated time against a clock.

    Args:
        clock: Seconds that pass [s].

    Attributes:
        speed: Simulated seconds in a hundred of the clock's: 100 is real time.
        measured: The speed that is kept, or -1 if none has been measured.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.speed = 100.0
        self.begin(0.0)

    def begin(self, time: float) -> None:
        """Pace from a simulated time on, which is now [s]."""
        self._from = (self._clock(), time)
        self._measured_from = self._from
        self.measured = -1.0

    def steps_due(self, time: float, timestep: float) -> int:
        """How many physics steps are due [s]."""
        now = self._clock()
        since, start = self._from
        behind = start + (now - since) * self.speed / 100.0 - time
        if behind > MOST_BEHIND_S:
            self._from = (now, time + MOST_BEHIND_S)
            behind = MOST_BEHIND_S
        elapsed = now - self._measured_from[0]
        if elapsed >= MEASURED_OVER_S:
            self.measured = 100.0 * (time - self._measured_from[1]) / elapsed
            self._measured_from = (now, time)
        return max(0, int(behind / timestep + 1e-6))
