"""Rate and remaining time of a progress, in words."""

from __future__ import annotations

import time
from collections.abc import Callable

LINE_S = 60.0
"""Time between two lines, where there is no terminal [s]."""
SOON_S = 1.0
"""Time before a rate is known [s]."""


class ProgressRate:
    """The mean rate of a progress since its beginning.

    Args:
        unit: Plural of the counted things, such as `trials`.
        total: The total count.
        before: The count at the beginning.
        clock: Returns the time [s].
    """

    def __init__(
        self, unit: str, total: float, before: float = 0.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.unit, self.total, self.before = unit, total, before
        self._clock = clock
        self._start = self._line = clock()

    def text(self, done: float) -> str:
        """Return text such as `310 trials a second, 4 min left`; empty while the rate is unknown."""
        passed, new = self._clock() - self._start, done - self.before
        if passed < SOON_S or new <= 0.0:
            return ""
        rate = new / passed
        speed = f"{rate:.0f}" if rate >= 10.0 else f"{rate:.2g}"
        return f"{speed} {self.unit} a second, {duration_text((self.total - done) / rate)} left"

    def line(self, done: float) -> str | None:
        """Return a line of its own, if one is due: one a minute."""
        now = self._clock()
        if now - self._line < LINE_S:
            return None
        self._line = now
        rate = self.text(done)
        return f"{int(done)} of {int(self.total)} {self.unit}" + (f", {rate}" if rate else "")


def duration_text(left: float) -> str:
    """Write seconds as seconds, minutes or hours."""
    if left < 99.5:
        return f"{left:.0f} s"
    return f"{left / 60.0:.0f} min" if left < 99.5 * 60.0 else f"{left / 3600.0:.1f} h"
