"""Play between the servos' motors and their gimbals, held by friction: a gimbal rests until its motor has crossed it.

In velocity mode a servo's motor turns at the commanded rate, whatever the gap behind it. Encoders sit on the gimbals.
The observers get the command, not the motion of the gimbals.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from cmg_mj.core.arrays import Scalar, clip, where

ARCMIN_A_DEGREE = 60.0


class Backlash:
    """The play operator: gimbal+ = gimbal, limited to motor+ -+ gap/2, from the middle of the gap.

    Args:
        gap: From one side to the other, a float or an array (n_worlds,) [rad].
        dt: Control period [s].
    """

    def __init__(self, gap: Scalar, dt: float) -> None:
        self.gap = gap
        self._dt = dt
        self._motor: Scalar = None
        self._gimbal: Scalar = None

    def __call__(self, u: Scalar) -> Scalar:
        """Return the gimbals' rate under a command that is held for a period.

        Args:
            u: The rate of the motors [rad/s].

        Returns:
            The rate at which the gimbals are turned meanwhile; where there is no gap, u itself [rad/s].
        """
        if self._motor is None:
            self._motor = self._gimbal = 0.0 * u
        half = self.gap / 2.0
        self._motor = self._motor + u * self._dt
        before = self._gimbal
        self._gimbal = clip(before, self._motor - half, self._motor + half)
        return where(self.gap > 0.0, (self._gimbal - before) / self._dt, u)


def backlash(gap: Scalar) -> tuple[Callable[[float], Backlash], ...]:
    """Make the stage of servos whose gap is not zero in every world [rad]."""
    return () if type(gap) is float and not gap else (partial(Backlash, gap),)
