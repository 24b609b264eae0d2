"""A push: a torque on the frame about the tilt axis, for a while."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.fields import STRICT, Duration, Instant

AFTER_PUSH_S = 1.0
"""What an estimate is worth shows from a push's start until so long after its end [s]: at other times the rig hardly
moves, and an estimate of zero does well."""

Window = tuple[float, float]
"""Start, included, and end, excluded [s]."""


@dataclass(frozen=True, config=STRICT)
class Push:
    """A torque from outside.

    Attributes:
        start_s: When it begins [s].
        duration_s: How long it lasts [s].
        torque_n_m: Torque about the tilt axis [N m].
        axis: Name of that axis, on a rig of several.
    """

    start_s: Instant
    duration_s: Duration = 0.1
    torque_n_m: float = 1.0
    axis: str | None = None

    @property
    def end_s(self) -> float:
        """When it ends [s]."""
        return self.start_s + self.duration_s


def push_windows(pushes: Iterable[Push]) -> list[Window]:
    """From each push's start to a second after its end; those that overlap or touch are one."""
    windows: list[Window] = []
    for start, end in sorted((push.start_s, push.end_s + AFTER_PUSH_S) for push in pushes):
        if windows and start <= windows[-1][1]:
            windows[-1] = windows[-1][0], max(end, windows[-1][1])
        else:
            windows.append((start, end))
    return windows


def inside(time: np.ndarray, windows: Sequence[Window]) -> np.ndarray:
    """Which of these times [s] lie in any of the windows; the same shape."""
    found = np.zeros(np.shape(time), dtype=bool)
    for start, end in windows:
        found |= (time > start - 1e-9) & (time < end - 1e-9)
    return found
