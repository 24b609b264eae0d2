"""How the report writes what several papers have."""

from __future__ import annotations

from cmg_mj.intervals import Interval


def with_half(interval: Interval | None, digits: int = 4) -> str:
    """A mean and half its interval: `0.0601 +- 0.0005`; a dash where there is none."""
    return "-" if interval is None else f"{interval.mean:.{digits}f} +- {interval.half:.{digits}f}"
