"""Play between the servos' motors and their gimbals, held by friction: a gimbal rests until its motor has crossed it.

In velocity mode a servo's motor turns at the commanded rate, whatever the gap behind it. Encoders sit on the gimbals.
The observers get the command, not the motion of the gimbals.
"""

from __future__ import annotations

from dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip, where
from cmg_mj.core.sensor import Memory

ARCMIN_A_DEGREE = 60.0


@dataclass(frozen=True)
class Backlash:
    """The play operator: gimbal+ = gimbal, limited to motor+ -+ gap/2, from the middle of the gap.

    Attributes:
        gap: From one side to the other, a float or an array (n_worlds,) [rad].
        dt: Control period [s].
    """

    gap: Scalar
    dt: float

    def init(self, u: Scalar) -> Memory:
        """Return the angles of motor and gimbal [rad]."""
        return 0.0 * u, 0.0 * u

    def step(self, memory: Memory, u: Scalar) -> tuple[Memory, Scalar]:
        """Return the gimbals' rate under a command that is held for a period.

        Args:
            memory: The memory.
            u: The rate of the motors [rad/s].

        Returns:
            The next memory, and the rate at which the gimbals are turned meanwhile; where there is no gap, u itself
            [rad/s].
        """
        motor, before = memory
        half = self.gap / 2.0
        motor = motor + u * self.dt
        gimbal = clip(before, motor - half, motor + half)
        return (motor, gimbal), where(self.gap > 0.0, (gimbal - before) / self.dt, u)


def backlash(gap: Scalar, dt: float) -> tuple[Backlash, ...]:
    """Make the stage of servos whose gap is not zero in every world [rad]."""
    return () if type(gap) is float and not gap else (Backlash(gap, dt),)
