"""Counts of the reasons why trials of a sweep were refused or stopped."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

KINDS = 100
"""Kinds of reasons that are counted apart; further ones are counted together."""
LONGEST = 240
"""Most letters of a reason."""
OTHERS = "other reasons"
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?([eE][-+]?\d+)?(?![\w.]*\w)")


class Reasons:
    """Counts of the reasons why trials never ran to an end, in bounded memory.

    Reasons that differ in their numbers alone are of one kind, which the first of them stands for.

    Args:
        field: The last varied field: a refusal begins with the values of all, which are discarded.
    """

    def __init__(self, field: str) -> None:
        self._field = field
        self._counts: Counter[tuple[str, str]] = Counter()
        self._first: dict[tuple[str, str], str] = {}
        self._differ: set[tuple[str, str]] = set()

    def add(self, ended: Iterable[tuple[str, str | None]]) -> None:
        """Count trials that neither stood nor fell: outcome and reason of each."""
        for (outcome, reason), n in Counter(ended).items():
            text = self._short(outcome, reason or "no reason is given")
            kind = (outcome, NUMBER.sub("#", text))
            if kind not in self._first and len(self._first) >= KINDS:
                kind, text = (outcome, OTHERS), OTHERS
            if self._first.setdefault(kind, text) != text:
                self._differ.add(kind)
            self._counts[kind] += n

    @property
    def trials(self) -> int:
        """Number of trials."""
        return self._counts.total()

    @property
    def kinds(self) -> int:
        """Number of different reasons."""
        return len(self._counts)

    def most(self, n: int) -> list[str]:
        """List the most frequent kinds of reasons, with counts."""
        return [
            f"{count} {kind[0]}{', such as' if kind in self._differ else ''}: {self._first[kind]}"
            for kind, count in self._counts.most_common(n)
        ]

    def _short(self, outcome: str, reason: str) -> str:
        """Put a reason on one line, without the values of its point where it begins with them."""
        if outcome == "refused" and f"{self._field}=" in reason:
            reason = reason.partition(f"{self._field}=")[2].partition(": ")[2] or reason
        line = " ".join(reason.split())
        return line if len(line) <= LONGEST else f"{line[:LONGEST]}..."
