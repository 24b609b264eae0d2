"""The numbers of a rig of several axes: those of each, and of each number the worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmg_mj.results.summary_keys import AXES, KEYS


def combine_axes(axes: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """One world's summary.

    Args:
        axes: The summary of each axis, by its name.

    Returns:
        That of a rig's only axis. Of several: each number is that of the axis where it is worst, None where an axis
        has none; `axes` has each axis' own.
    """
    if len(axes) == 1:
        return next(iter(axes.values()))
    return {**_worst(list(axes.values())), AXES: dict(axes)}


def _worst(summaries: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, first in summaries[0].items():
        values = [summary[key] for summary in summaries if key in summary]
        if len(values) < len(summaries):  # the axes' observers differ
            continue
        if isinstance(first, Mapping):
            found[key] = _worst(values)
        elif any(value is None for value in values):
            found[key] = None
        else:
            found[key] = min(values) if key in KEYS and KEYS[key].better == "more" else max(values, key=abs)
    return found
