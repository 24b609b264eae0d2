"""A notch on the command: it removes the part of the law's command at the frequency of a mode."""

from __future__ import annotations

import math
from functools import partial

from cmg_mj.core.arrays import Scalar, clip
from cmg_mj.core.errors import InputError
from cmg_mj.core.types import Law

DEPTH_DAMPING, WIDTH_DAMPING = 0.02, 0.5
"""Damping ratios of the notch's zeros and poles: a 25th of the command remains at its middle."""


class Notch:
    """(s^2 + 2 z1 w s + w^2)/(s^2 + 2 z2 w s + w^2) by Tustin's rule, exact at w, from rest.

    Args:
        frequency_hz: Its middle, w/(2 pi), below half the control rate [Hz].
        dt: Control period [s].
        limit: Largest gimbal rate, a float or an array (n_worlds,) [rad/s].

    Attributes:
        numerator: Coefficients on the commands, the newest first.
        denominator: Coefficients on the results, the newest first, 1 the first of them.
    """

    def __init__(self, frequency_hz: float, dt: float, limit: Scalar) -> None:
        self._limit = limit
        t = math.tan(math.pi * frequency_hz * dt)
        plain, middle = 1.0 + t * t, 2.0 * (t * t - 1.0)
        whole = plain + 2.0 * WIDTH_DAMPING * t
        zeros, poles = 2.0 * DEPTH_DAMPING * t, 2.0 * WIDTH_DAMPING * t
        self.numerator = (plain + zeros) / whole, middle / whole, (plain - zeros) / whole
        self.denominator = 1.0, middle / whole, (plain - poles) / whole
        self._one: Scalar = 0.0
        self._two: Scalar = 0.0

    def __call__(self, u: Scalar) -> Scalar:
        """Return the command without what it has of the mode's frequency.

        Args:
            u: The law's command [rad/s].

        Returns:
            The command for the gimbals, within the limit [rad/s].
        """
        b0, b1, b2 = self.numerator
        _, a1, a2 = self.denominator
        result = b0 * u + self._one
        self._one = b1 * u - a1 * result + self._two
        self._two = b2 * u - a2 * result
        return clip(result, -self._limit, self._limit)


def notches(middle_hz: float, law: Law) -> list[partial[Notch]]:
    """List what makes the stage of a controller with a notch; nothing for 0 Hz.

    Raises:
        InputError: The notch is above half the control rate.
    """
    if middle_hz * law.dt >= 0.5:
        limit = 0.5 / law.dt
        raise InputError(f"controller.notch_hz = {middle_hz:g}: must be below {limit:g} Hz, half of controller.rate_hz")
    return [partial(Notch, middle_hz, law.dt, law.rate_limit)] if middle_hz else []
