"""What is asked of a mount, looked at before anything is read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmg_mj.errors import InputError, nearest
from cmg_mj.plant.mounting.axes import AxisLike
from cmg_mj.plant.mounting.held_joints import Hold

SCALES = 0.05, 20.0
MOST_CUBES = 16
HOLDS = "constraints", "servos"
BASES = "as_is", "free"


@dataclass(frozen=True)
class MountRequest:
    """The arguments of `mount`, which says what they mean."""

    body: str
    axis: AxisLike
    at: Sequence[float] | None
    cubes: int
    scale: float
    name: str
    keyframe: str | None
    hold: Hold
    free: Sequence[str]
    base: str

    def __post_init__(self) -> None:
        if not (isinstance(self.cubes, int) and 1 <= self.cubes <= MOST_CUBES):
            raise InputError(f"--cubes {self.cubes}: must be from 1 to {MOST_CUBES}")
        if not (isinstance(self.scale, (int, float)) and SCALES[0] <= self.scale <= SCALES[1]):
            raise InputError(f"--scale {self.scale}: must be from {SCALES[0]:g} to {SCALES[1]:g}")
        if not (isinstance(self.name, str) and (not self.name or self.name.isidentifier())):
            raise InputError(f"--name {self.name}: must be a word, such as roll")
        if self.at is not None and not _is_point(self.at):
            raise InputError(f"--at {self.at}: must be three numbers, a point in the body's frame [m]")
        if self.hold not in HOLDS:
            raise InputError(f"--hold {self.hold}: {nearest(str(self.hold), HOLDS, 'must be one of')}")
        if self.base not in BASES:
            raise InputError(f"base={self.base!r}: {nearest(str(self.base), BASES, 'must be one of')}")

    @property
    def prefix(self) -> str:
        """What the names of the axis' elements begin with."""
        return f"{self.name}/" if self.name else ""


def _is_point(at: object) -> bool:
    try:
        point = np.array(at, dtype=float)
    except (TypeError, ValueError):
        return False
    return point.shape == (3,) and bool(np.isfinite(point).all())
