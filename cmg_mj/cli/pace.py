"""How fast something goes, and how long it still takes, in words."""

from __future__ import annotations

import time
from collections.abc import Callable

LINE_S = 60.0
"""Between two lines, where there is no terminal."""
SOON_S = 1.0
"""Before so much has passed nobody can tell."""


class ProgressRate:
    """The pace of what is counted, by all that was done since the beginning.

    Args:
        unit: What is counted, such as `trials`.
        total: How many there are.
        before: How many were done before the beginning.
        clock: Says how late it is [s].
    """

    def __init__(
        self, unit: str, total: float, before: float = 0.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.unit, self.total, self.before = unit, total, before
        self._clock = clock
        self._start = self._line = clock()

    def said(self, done: float) -> str:
        """Such as `310 trials a second, 4 min left`; nothing as long as nobody can tell."""
        passed, new = self._clock() - self._start, done - self.before
        if passed < SOON_S or new <= 0.0:
            return ""
        rate = new / passed
        speed = f"{rate:.0f}" if rate >= 10.0 else f"{rate:.2g}"
        return f"{speed} {self.unit} a second, {in_time((self.total - done) / rate)} left"

    def line(self, done: float) -> str | None:
        """A line of its own, if one is due: one a minute."""
        now = self._clock()
        if now - self._line < LINE_S:
            return None
        self._line = now
        said = self.said(done)
        return f"{int(done)} of {int(self.total)} {self.unit}" + (f", {said}" if said else "")


def in_time(left: float) -> str:
    """So many seconds in words: seconds, minutes or hours."""
    if left < 99.5:
        return f"{left:.0f} s"
    return f"{left / 60.0:.0f} min" if left < 99.5 * 60.0 else f"{left / 3600.0:.1f} h"
