"""Paces the simulation by a clock: in real time, or at a share of it."""

from __future__ import annotations

from collections.abc import Callable

MOST_BEHIND_S = 0.1
"""Largest delay that the simulation catches up; it discards more [s]."""
MEASURED_OVER_S = 0.5
"""Interval over which the speed is measured [s]."""


class StepScheduler:
    """Schedules physics steps by a clock.

    Args:
        clock: Returns the time [s].

    Attributes:
        speed: Speed of simulated time [% of real time].
        measured: The measured speed, or -1 if none has been measured [% of real time].
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.speed = 100.0
        self.begin(0.0)

    def begin(self, time: float) -> None:
        """Start pacing now, at a simulated time [s]."""
        self._from = (self._clock(), time)
        self._measured_from = self._from
        self.measured = -1.0

    def steps_due(self, time: float, timestep: float) -> int:
        """Return the number of physics steps due at a simulated time [s]."""
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
