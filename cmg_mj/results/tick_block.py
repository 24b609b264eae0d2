"""Ticks on their way to the metrics and to the trajectory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class TickBlock(NamedTuple):
    """Successive ticks as columns, (n_ticks, n_worlds) each.

    Attributes:
        x1: True tilt [rad].
        x2: True tilt rate [rad/s].
        x3: True gimbal angle [rad].
        y1: Measured tilt [rad].
        fog: The gyro's rate [rad/s].
        u: Command [rad/s].
        estimates: Signal -> values, for the observer in the loop and each open-loop observer; `x2_rad_s` among them.
        columns: The trajectory's columns after its time, in its order.
        ended: Which worlds have ended; None for one world.
    """

    x1: np.ndarray
    x2: np.ndarray
    x3: np.ndarray
    y1: np.ndarray
    fog: np.ndarray
    u: np.ndarray
    estimates: list[dict[str, np.ndarray]]
    columns: list[np.ndarray]
    ended: np.ndarray | None
