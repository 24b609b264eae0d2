"""Readings of perfect sensors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.elementwise import Scalar

Forces = Sequence[Scalar] | np.ndarray
"""Specific force: inner x, inner z, outer x, outer z [m/s^2]; floats, or one array (4, n_worlds)."""


class IdealReading(NamedTuple):
    """Readings of perfect sensors at one instant: floats, or arrays (n_worlds,)."""

    accelerations: Forces
    gimbals: Sequence[Scalar]
    """Gimbal angles, one a gimbal [rad]."""
    gyro: Scalar
    """Rate of the frame along the tilt axis, as a gyro on it measures [rad/s]."""
    rate: Scalar
    """The true tilt rate, q_b' [rad/s]: no sensor's, but what `feedback = "truth"` uses."""
    wheels: Sequence[Scalar] = ()
    """Rates of the flywheels, one a module [rad/s]: no sensor's, but what makes accelerometers vibrate."""


class MultiAxisReading(NamedTuple):
    """The readings of a rig of several axes."""

    axes: Sequence[IdealReading]
    """Readings of each axis."""
    turn_rate: Scalar
    """Upward rate of the frame, as a gyro on it measures [rad/s]."""
