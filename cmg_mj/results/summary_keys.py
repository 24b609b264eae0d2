"""Summaries of a run: their type, the names, units and digits of their numbers, and how axes are combined."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

if TYPE_CHECKING:
    import pyarrow as pa

Figures = dict[str, float | None]
"""Numbers of one estimator by their names; None where there is no such number."""
SummaryValue: TypeAlias = "float | str | Sequence[SummaryValue] | Mapping[str, SummaryValue] | None"
"""A number, a text, or a part of a summary."""
Summary = dict[str, SummaryValue]
"""Figures of a run, or of an observer of a comparison, as `--json` prints them."""


class Key(NamedTuple):
    """One number of a summary.

    Attributes:
        label: In words.
        unit: Empty for none.
        pattern: How it is written.
        compared: Whether it is a column where observers are compared, which has room for a few.
        better: Which values are; empty where it is neither good nor bad.
        positive: Whether no value is below zero, so that no end of a mean's interval may be.
    """

    label: str
    unit: str
    pattern: str
    compared: bool = True
    better: Literal["less", "more", ""] = "less"
    positive: bool = True

    @property
    def heading(self) -> str:
        """The label with its unit, as axes and columns want it."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


KEYS = {
    "velocity_rms_error_rad_s": Key("velocity RMS error", "rad/s", "{:.4f}"),
    "velocity_rms_error_push_rad_s": Key("error in push window", "rad/s", "{:.4f}"),
    "velocity_rms_error_fog_rad_s": Key("error against the gyro", "rad/s", "{:.4f}", compared=False),
    "velocity_rms_rad_s": Key("true velocity RMS", "rad/s", "{:.4f}", better=""),
    "velocity_fit": Key("fit", "", "{:.2f}", better="more", positive=False),
    "velocity_fit_push": Key("fit in push window", "", "{:.2f}", better="more", positive=False),
    "tilt_rms_deg": Key("tilt RMS", "deg", "{:.3f}"),
    "settle_time_s": Key("settle time", "s", "{:.2f}"),
    "gimbal_peak_deg": Key("gimbal peak", "deg", "{:.1f}"),
    "command_rms_rad_s": Key("command RMS", "rad/s", "{:.3f}"),
    "command_saturated_fraction": Key("command limited", "", "{:.1%}", compared=False),
    "bias_estimate_deg": Key("bias found", "deg", "{:.4f}", compared=False, positive=False),
    "bias_rms_error_deg": Key("bias RMS error", "deg", "{:.4f}", compared=False),
    "steps": Key("steps walked", "", "{:.0f}", compared=False, better="more"),
    "distance_m": Key("distance", "m", "{:.2f}", compared=False, better="more"),
    "gimbal_energy_j": Key("gimbals' energy a step", "J", "{:.3f}", compared=False),
    "leg_energy_j": Key("legs' energy a step", "J", "{:.2f}", compared=False),
    "fell_fraction": Key("fell", "", "{:.0%}", better=""),
    "stopped_fraction": Key("stopped", "", "{:.0%}", better=""),
}
"""Summary key -> what it is. In this order they stand in every table."""


AXES = "axes"
"""The part of a summary that holds the figures of each axis of several, by name."""
OPEN_LOOP_SECTIONS = ("open_loop_observers", "references")
"""Parts that hold the figures of open-loop observers and of baselines, by name."""
NESTED = (*OPEN_LOOP_SECTIONS, AXES)
"""Parts that hold figures of others by name."""


OPEN_LOOP_COLUMNS = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s", "velocity_fit", "velocity_fit_push")
"""Figures that tables show of open-loop observers and baselines."""


def heading(key: str) -> str:
    """Name a summary key in words, with its unit."""
    return KEYS[key].heading


def format_figure(key: str, value: SummaryValue, sign: str = "") -> str:
    """Format a summary's number for a table; a dash where there is none. With the sign "+", it always has one."""
    return "-" if value is None else KEYS[key].pattern.replace("{:", "{:" + sign).format(value)


def capitalised(text: str) -> str:
    """Begin a text with a capital; the rest, such as RMS, stays."""
    return text[:1].upper() + text[1:]


def finite(value: Any) -> Any:
    """Replace each number that JSON does not know by None, in a summary or a part of one."""
    if isinstance(value, Mapping):
        return {key: finite(part) for key, part in value.items()}
    if isinstance(value, list):
        return [finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def section(summary: Mapping[str, Any], name: str) -> dict[str, Mapping[str, Any]]:
    """Return the summaries that a part of a summary holds, by name; none where there is no such part."""
    return {**summary.get(name, {})}


def open_loop_figures(summary: Mapping[str, SummaryValue]) -> dict[str, Mapping[str, SummaryValue]]:
    """Return the figures of each open-loop observer, then of each baseline, by name."""
    return {name: figures for part in OPEN_LOOP_SECTIONS for name, figures in section(summary, part).items()}


def combine_axes(axes: Mapping[str, Summary]) -> Summary:
    """Combine the summaries of one world's axes.

    Args:
        axes: The summary of each axis, by its name.

    Returns:
        The summary of an only axis. Of several: each number from the axis where it is worst, None where an axis has
        none; `axes` has each axis' own.
    """
    if len(axes) == 1:
        return next(iter(axes.values()))
    return {**_worst(list(axes.values())), AXES: dict(axes)}


def _worst(summaries: Sequence[Mapping[str, SummaryValue]]) -> Summary:
    worst: Summary = {}
    for key in summaries[0]:
        values: list[Any] = [summary[key] for summary in summaries if key in summary]
        if len(values) < len(summaries):  # the axes' observers differ
            continue
        if isinstance(values[0], Mapping):
            worst[key] = _worst(values)
        elif None in values:
            worst[key] = None
        else:
            worst[key] = min(values) if key in KEYS and KEYS[key].better == "more" else max(values, key=abs)
    return worst


ID_COLUMNS = {
    "observer": "string",
    "in_loop_of": "string",
    "world": "int64",
    "seed": "int64",
    "outcome": "string",
    "stood": "bool",
    "end_time_s": "float64",
    "reason": "string",
}
"""Columns before the figures, and their types. `in_loop_of` names the observer in the loop, for those that are not.

Figures of a world that did not stand to the end are those until then: `stood` is false, and no mean may count them.
"""


def as_table(rows: Iterable[Summary]) -> pa.Table:
    """Make rows, a world each, into a table. A figure that an observer or a world does not have is null."""
    import pyarrow as pa

    worlds = list(rows)
    figures = dict.fromkeys(key for row in worlds for key in row if key not in ID_COLUMNS)
    schema = pa.schema([*ID_COLUMNS.items(), *((key, "float64") for key in figures)])
    return pa.Table.from_pylist(worlds, schema=schema)
