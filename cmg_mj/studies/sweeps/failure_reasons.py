"""Why trials of a sweep were refused or stopped, counted while they stream by."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

KINDS = 100
"""Of reasons that are kept apart; further ones are counted together."""
LONGEST = 240
"""Letters of a reason that are kept."""
OTHERS = "other reasons"
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?([eE][-+]?\d+)?(?![\w.]*\w)")


class Reasons:
    """How many trials never ran to an end, and why, in bounded memory.

    Reasons that differ in their numbers alone are of one kind, which the first of them stands for.

    Args:
        field: The last of those that are varied: a refusal begins with all their values, which are left out.
    """

    def __init__(self, field: str) -> None:
        self._field = field
        self._counts: Counter[tuple[str, str]] = Counter()
        self._first: dict[tuple[str, str], str] = {}
        self._differ: set[tuple[str, str]] = set()

    def add(self, ended: Iterable[tuple[str, str | None]]) -> None:
        """Count trials that neither stood nor fell: how each ended, and why."""
        for (outcome, reason), n in Counter(ended).items():
            said = self._short(outcome, reason or "no reason is given")
            kind = (outcome, NUMBER.sub("#", said))
            if kind not in self._first and len(self._first) >= KINDS:
                kind, said = (outcome, OTHERS), OTHERS
            if self._first.setdefault(kind, said) != said:
                self._differ.add(kind)
            self._counts[kind] += n

    @property
    def trials(self) -> int:
        """How many there are."""
        return self._counts.total()

    @property
    def kinds(self) -> int:
        """How many different reasons there are."""
        return len(self._counts)

    def most(self, n: int) -> list[str]:
        """The most frequent kinds of reasons, with counts."""
        return [
            f"{count} {kind[0]}{', such as' if kind in self._differ else ''}: {self._first[kind]}"
            for kind, count in self._counts.most_common(n)
        ]

    def _short(self, outcome: str, reason: str) -> str:
        """One line; without the values of its point, where it begins with them."""
        if outcome == "refused" and f"{self._field}=" in reason:
            reason = reason.partition(f"{self._field}=")[2].partition(": ")[2] or reason
        line = " ".join(reason.split())
        return line if len(line) <= LONGEST else f"{line[:LONGEST]}..."
