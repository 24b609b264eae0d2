"""The numbers in a claim's words."""

from __future__ import annotations

from collections.abc import Sequence

from cmg_mj.results.intervals import Interval


def plus_minus(interval: Interval | None, digits: int = 4, *, with_sign: bool = False) -> str:
    """Write a mean with half its interval, `0.0601 +- 0.0005`; a dash where there is none.

    Args:
        interval: The interval.
        digits: So many after the point.
        with_sign: Whether a positive mean has its sign.

    Returns:
        The words.
    """
    if interval is None:
        return "-"
    return f"{interval.mean:{'+' if with_sign else ''}.{digits}f} +- {interval.half:.{digits}f}"


def join_with_and(words: Sequence[str]) -> str:
    """Join one or several things as a sentence lists them: `a`, `a and b`, `a, b and c`."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last
