"""Torques from outside: pushes, held for a while, and swings, sinusoids such as the legs' of a gait."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.elementwise import Scalar
from cmg_mj.inputs.types import STRICT, Batched, Duration, GridDuration, GridInstant, Instant

AFTER_PUSH_S = 1.0
"""Estimates are judged from a push's start until so long after its end [s]: at other times the rig hardly
moves, and an estimate of zero does well."""

Window = tuple[float, float]
"""Start, included, and end, excluded [s]."""


@dataclass(frozen=True, config=STRICT)
class Push:
    """A constant torque about the tilt axis for a while.

    Attributes:
        start_s: Time at which the push begins [s].
        duration_s: Duration of the push [s].
        torque_n_m: Torque about the tilt axis [N m].
        axis: Name of the tilt axis, on a rig of several axes.
    """

    start_s: GridInstant
    duration_s: GridDuration = 0.1
    torque_n_m: Annotated[float, Batched()] = 1.0
    axis: str | None = None

    @property
    def end_s(self) -> float:
        """When it ends [s]."""
        return self.start_s + self.duration_s


@dataclass(frozen=True, config=STRICT)
class Swing:
    """A sinusoidal torque about the tilt axis, such as a gait's. Each sample holds the value at its middle.

    Attributes:
        frequency_hz: Frequency of the torque [Hz].
        amplitude_n_m: Amplitude of the torque about the tilt axis [N m].
        phase_deg: Phase of the torque at its start [deg].
        start_s: Time at which the torque begins [s].
        duration_s: Duration of the torque; without it, to the end of the run [s].
        axis: Name of the tilt axis, on a rig of several axes.
    """

    frequency_hz: Annotated[float, Field(gt=0.0, le=20.0)]
    amplitude_n_m: float = 0.5
    phase_deg: float = 0.0
    start_s: Instant = 0.0
    duration_s: Duration | None = None
    axis: str | None = None

    def torque(self, time: float) -> float:
        """At a time [N m]."""
        since = time - self.start_s
        if since < 0.0 or (self.duration_s is not None and since >= self.duration_s):
            return 0.0
        return self.amplitude_n_m * math.sin(2.0 * math.pi * self.frequency_hz * since + math.radians(self.phase_deg))


def push_windows(pushes: Iterable[Push]) -> list[Window]:
    """Return the windows from each push's start to a second after its end; windows that overlap or touch are one."""
    windows: list[Window] = []
    for start, end in sorted((push.start_s, push.end_s + AFTER_PUSH_S) for push in pushes):
        if windows and start <= windows[-1][1]:
            windows[-1] = windows[-1][0], max(end, windows[-1][1])
        else:
            windows.append((start, end))
    return windows


def inside(time: np.ndarray, windows: Sequence[Window]) -> np.ndarray:
    """Return a mask of the times [s] that lie in any of the windows, of the same shape."""
    mask = np.zeros(np.shape(time), dtype=bool)
    for start, end in windows:
        mask |= (time > start - 1e-9) & (time < end - 1e-9)
    return mask


def add_swing_torques(
    torques: Sequence[Scalar], swings: Sequence[Swing], axes: Sequence[str], time: float
) -> Sequence[Scalar]:
    """Each axis' torque with that of the swings.

    Args:
        torques: Without them, one an axis [N m].
        swings: The swings; one about an axis that the rig does not have, since it is locked, moves nothing.
        axes: The axes' names.
        time: When [s].

    Returns:
        The sums; the list itself if there is no swing.
    """
    if not swings:
        return torques
    added = [sum(swing.torque(time) for swing in swings if (swing.axis or axes[0]) == axis) for axis in axes]
    return [torque + more for torque, more in zip(torques, added, strict=True)]
