"""The arguments of `mount`, checked before a file is read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.features.mounting.axes import AxisLike
from cmg_mj.features.mounting.held_joints import Hold

SCALES = 0.05, 20.0
MOST_MODULES = 16
Base = Literal["as_is", "free"]
HOLDS, BASES = get_args(Hold), get_args(Base)


@dataclass(frozen=True)
class MountRequest:
    """The arguments of `mount`, which says what they mean."""

    body: str
    axis: AxisLike
    position: Sequence[float] | None
    modules: int
    scale: float
    name: str
    keyframe: str | None
    hold: Hold
    release: Sequence[str]
    base: Base

    def __post_init__(self) -> None:
        if not (isinstance(self.modules, int) and 1 <= self.modules <= MOST_MODULES):
            raise InputError(f"--modules {self.modules}: must be from 1 to {MOST_MODULES}")
        if not (isinstance(self.scale, (int, float)) and SCALES[0] <= self.scale <= SCALES[1]):
            raise InputError(f"--scale {self.scale}: must be from {SCALES[0]:g} to {SCALES[1]:g}")
        if not (isinstance(self.name, str) and (not self.name or self.name.isidentifier())):
            raise InputError(f"--name {self.name}: must be a word, such as roll")
        if self.position is not None and not _is_point(self.position):
            raise InputError(f"--position {self.position}: must be three numbers, a point in the body's frame [m]")
        if self.hold not in HOLDS:
            raise InputError(f"--hold {self.hold}: {nearest(str(self.hold), HOLDS, 'must be one of')}")
        if self.base not in BASES:
            raise InputError(f"base={self.base!r}: {nearest(str(self.base), BASES, 'must be one of')}")

    @property
    def prefix(self) -> str:
        """The first part of the names of the axis' elements, such as `roll/`."""
        return f"{self.name}/" if self.name else ""


def _is_point(position: Sequence[float]) -> bool:
    try:
        point = np.array(position, dtype=float)
    except (TypeError, ValueError):
        return False
    return point.shape == (3,) and bool(np.isfinite(point).all())
