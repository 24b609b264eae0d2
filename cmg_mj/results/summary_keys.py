"""What the numbers of a summary are called, their units and how many digits of them are worth showing."""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple


class Key(NamedTuple):
    """One number of a summary.

    Attributes:
        label: In words.
        unit: Empty for none.
        pattern: How it is written.
        compared: Whether it is a column where observers are compared, which has room for a few.
        better: Which values are; empty where it is neither good nor bad.
    """

    label: str
    unit: str
    pattern: str
    compared: bool = True
    better: Literal["less", "more", ""] = "less"

    @property
    def heading(self) -> str:
        """The label with its unit, as axes and columns want it."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


KEYS = {
    "velocity_rms_error_rad_s": Key("velocity RMS error", "rad/s", "{:.4f}"),
    "velocity_rms_error_push_rad_s": Key("error in push window", "rad/s", "{:.4f}"),
    "velocity_rms_error_fog_rad_s": Key("error against the gyro", "rad/s", "{:.4f}", compared=False),
    "velocity_rms_rad_s": Key("true velocity RMS", "rad/s", "{:.4f}", better=""),
    "velocity_fit": Key("fit", "", "{:.2f}", better="more"),
    "velocity_fit_push": Key("fit in push window", "", "{:.2f}", better="more"),
    "tilt_rms_deg": Key("tilt RMS", "deg", "{:.3f}"),
    "settle_time_s": Key("settle time", "s", "{:.2f}"),
    "gimbal_peak_deg": Key("gimbal peak", "deg", "{:.1f}"),
    "command_rms_rad_s": Key("command RMS", "rad/s", "{:.3f}"),
    "command_saturated_fraction": Key("command limited", "", "{:.1%}", compared=False),
    "bias_estimate_deg": Key("bias found", "deg", "{:.4f}", compared=False),
    "bias_rms_error_deg": Key("bias RMS error", "deg", "{:.4f}", compared=False),
    "fell_fraction": Key("fell", "", "{:.0%}", better=""),
    "stopped_fraction": Key("stopped", "", "{:.0%}", better=""),
}
"""Summary key -> what it is. In this order they stand in every table."""


AXES = "axes"
"""The part of a summary that holds the figures of each axis of several, by name."""
OPEN_LOOP_SECTIONS = ("open_loop_observers", "references")
"""Parts that hold the figures of what rode along, by name."""
NESTED = (*OPEN_LOOP_SECTIONS, AXES)
"""Parts that hold figures of others by name."""


OPEN_LOOP_COLUMNS = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s", "velocity_fit", "velocity_fit_push")
"""What tables show of everything that rode along."""


def heading(key: str) -> str:
    """A summary key in words, with its unit."""
    return KEYS[key].heading


def written(key: str, value: Any) -> str:
    """A summary's number as tables show it; a dash where there is none."""
    return "-" if value is None else KEYS[key].pattern.format(value)


def spread(key: str, half: float | None) -> str:
    """Half the width of a number's interval as tables show it; nothing where there is none."""
    return "" if half is None else "±" + KEYS[key].pattern.format(half)


def difference(key: str, value: float | None) -> str:
    """A difference of two numbers as tables show it, with its sign."""
    return "-" if value is None else KEYS[key].pattern.replace("{:", "{:+").format(value)


def finite(value: Any) -> Any:
    """None for a number that JSON does not know."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
