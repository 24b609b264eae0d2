"""y2 from the gimbals' encoders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from cmg_mj.elementwise import Scalar, dot


@dataclass(frozen=True)
class GimbalAngle:
    """y2 from the encoders: of a scissored pair half their difference.

    Attributes:
        directions: For each gimbal +1 or -1: the sign of u that it is given.
        zeros: For each gimbal the angle at which y2 = 0 [rad].
    """

    directions: tuple[float, ...]
    zeros: tuple[float, ...]

    @cached_property
    def _shares(self) -> list[float]:
        return [direction / len(self.directions) for direction in self.directions]

    @cached_property
    def _less_zero(self) -> float:
        return -dot(self._shares, self.zeros)

    def __call__(self, encoders: Sequence[Scalar]) -> Scalar:
        """y2 [rad] from the gimbals' angles, one a gimbal [rad]."""
        y2 = self._less_zero
        for share, angle in zip(self._shares, encoders, strict=True):
            y2 = y2 + share * angle
        return y2
