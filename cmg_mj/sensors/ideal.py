"""What perfect sensors would show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.elementwise import Scalar

Forces = Sequence[Scalar] | np.ndarray
"""Specific force: inner x, inner z, outer x, outer z [m/s^2]; floats, or one array (4, n_worlds)."""


class IdealReading(NamedTuple):
    """What perfect sensors would show at one instant (floats, or arrays (n_worlds,))."""

    accelerations: Forces
    gimbals: Sequence[Scalar]
    """Gimbal angles, one a gimbal [rad]."""
    gyro: Scalar
    """What a gyro on the frame shows along the tilt axis [rad/s]."""
    rate: Scalar
    """The true tilt rate, q_b' [rad/s]: no sensor's, but what `feedback = "truth"` uses."""


class MultiAxisReading(NamedTuple):
    """The same of a rig of several axes."""

    axes: Sequence[IdealReading]
    """What those of each axis would show."""
    turn_rate: Scalar
    """What a gyro on the frame shows upward [rad/s]."""
