"""Pushes: constant torques about the tilt axes for a while, and the times in which estimates are judged by them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import Annotated

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, where
from cmg_mj.core.loop import Disturbance, Outside
from cmg_mj.core.sensor import whole_steps
from cmg_mj.inputs.types import STRICT, Batched, GridDuration, GridInstant, Section, Start

AFTER_PUSH_S = 1.0
"""Estimates are judged from a push's start until so long after its end [s]: at other times the rig hardly
moves, and an estimate of zero does well."""

Window = tuple[float, float]
"""Start, included, and end, excluded [s]."""


@dataclass(frozen=True, config=STRICT)
class Push(Section):
    """A constant torque about the tilt axis for a while.

    Attributes:
        start_s: Time at which the push begins [s].
        duration_s: Duration of the push [s].
        torque_n_m: Torque about the tilt axis [N m].
        axis: Name of the tilt axis, on a rig of several axes.
    """

    start_s: Annotated[GridInstant, Section, Start()]
    duration_s: GridDuration = 0.1
    torque_n_m: Annotated[float, Batched()] = 1.0
    axis: str | None = None

    @property
    def end_s(self) -> float:
        """When it ends [s]."""
        return self.start_s + self.duration_s

    @property
    def words(self) -> str:
        """The push in words."""
        about = f" about {self.axis}" if self.axis else ""
        return f"{self.torque_n_m:g} N m{about} from {self.start_s:g} s to {self.end_s:g} s"


class Pushes(Disturbance):
    """The torques of pushes. A push about an axis that the rig does not have, since it is locked, moves nothing.

    Args:
        pushes: The pushes; a torque may be an array (n_worlds,).
        timestep: Physics step [s].
        axes: The axes' names.
    """

    def __init__(self, pushes: Sequence[Push], timestep: float, axes: Sequence[str]) -> None:
        changes: dict[int, list[Scalar]] = {0: [0.0] * len(axes)}
        for push in pushes:
            for time, torque in ((push.start_s, push.torque_n_m), (push.end_s, -push.torque_n_m)):
                step = whole_steps(time, timestep, "push", f"{time:g} s")
                change = changes.setdefault(step, [0.0] * len(axes))
                about = push.axis or axes[0]
                if about in axes:
                    change[axes.index(about)] += torque
        self.edges = sorted(changes)
        self._outsides = []
        torques: list[Scalar] = [0.0] * len(axes)
        for step in self.edges:
            torques = [torque + more for torque, more in zip(torques, changes[step], strict=True)]
            held = [where(abs(torque) > 1e-12, torque, 0.0) for torque in torques]  # no remainders
            self._outsides.append(Outside(held))

    def at(self, step: int, steps: int) -> Outside:
        """Return the torques: see `Disturbance`."""
        return self._outsides[bisect_right(self.edges, step) - 1]


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
