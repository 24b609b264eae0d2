"""A notch on the command: it removes the part of the law's command at the frequency of a mode."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from cmg_mj.core.arrays import Scalar, clip
from cmg_mj.core.errors import InputError
from cmg_mj.core.sensor import Memory
from cmg_mj.core.types import Law

DEPTH_DAMPING, WIDTH_DAMPING = 0.02, 0.5
"""Damping ratios of the notch's zeros and poles: a 25th of the command remains at its middle."""


@dataclass(frozen=True)
class Notch:
    """(s^2 + 2 z1 w s + w^2)/(s^2 + 2 z2 w s + w^2) by Tustin's rule, exact at w, from rest.

    Attributes:
        frequency_hz: Its middle, w/(2 pi), below half the control rate [Hz].
        dt: Control period [s].
        limit: Largest gimbal rate, a float or an array (n_worlds,) [rad/s].
    """

    frequency_hz: float
    dt: float
    limit: Scalar

    def init(self, u: Scalar) -> Memory:
        """Return the memory at rest."""
        return 0.0 * u, 0.0 * u

    def step(self, memory: Memory, u: Scalar) -> tuple[Memory, Scalar]:
        """Take from a command what it has of the mode's frequency.

        Args:
            memory: The memory.
            u: The law's command [rad/s].

        Returns:
            The next memory, and the command for the gimbals, within the limit [rad/s].
        """
        b0, b1, b2 = self.numerator
        _, a1, a2 = self.denominator
        one, two = memory
        result = b0 * u + one
        after = b1 * u - a1 * result + two, b2 * u - a2 * result
        return after, clip(result, -self.limit, self.limit)

    @cached_property
    def numerator(self) -> tuple[float, float, float]:
        """Coefficients on the commands, the newest first."""
        t, plain, middle, whole = self._numbers
        zeros = 2.0 * DEPTH_DAMPING * t
        return (plain + zeros) / whole, middle / whole, (plain - zeros) / whole

    @cached_property
    def denominator(self) -> tuple[float, float, float]:
        """Coefficients on the results, the newest first, 1 the first of them."""
        t, plain, middle, whole = self._numbers
        poles = 2.0 * WIDTH_DAMPING * t
        return 1.0, middle / whole, (plain - poles) / whole

    @property
    def _numbers(self) -> tuple[float, float, float, float]:
        t = math.tan(math.pi * self.frequency_hz * self.dt)
        plain = 1.0 + t * t
        return t, plain, 2.0 * (t * t - 1.0), plain + 2.0 * WIDTH_DAMPING * t


def notches(middle_hz: float, law: Law) -> list[Notch]:
    """List the stage of a controller with a notch; nothing for 0 Hz.

    Raises:
        InputError: The notch is above half the control rate.
    """
    if middle_hz * law.dt >= 0.5:
        limit = 0.5 / law.dt
        raise InputError(f"controller.notch_hz = {middle_hz:g}: must be below {limit:g} Hz, half of controller.rate_hz")
    return [Notch(middle_hz, law.dt, law.rate_limit)] if middle_hz else []
