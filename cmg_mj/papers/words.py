"""How numbers are written in a claim's words."""

from __future__ import annotations

from cmg_mj.intervals import Interval


def plus_minus(interval: Interval | None, digits: int = 4) -> str:
    """A mean with half its interval, `0.0601 +- 0.0005`; `none` where there is none."""
    return "none" if interval is None else f"{interval.mean:.{digits}f} +- {interval.half:.{digits}f}"
