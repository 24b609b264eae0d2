"""Two accelerometers named the wrong way round: the tilt then turns against its own angular acceleration.

With a = (x_outer - x_inner) / (r_outer - r_inner) the angular acceleration and y the tilt, y'' = a. Of interchanged
columns a has the other sign, and for gravity's tangential part g sin y stands g sin y - (r_inner + r_outer) y''. But
for the square of the rate

    a -> -a,    y -> y - asin((r_inner + r_outer) a cos(y) / g)

takes both back. The noise of both is the same either way. Of violent swings (30 degrees at 2 Hz) the square of the rate
counts, and nothing is said.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmg_mj.replay.logs.tilt_acceleration import second_derivative_pairs
from cmg_mj.sensors.accelerometer import STANDARD_GRAVITY
from cmg_mj.sensors.tilt import RadialTilt

CLEAR = 0.5
"""So far they must agree the other way round, where 1 is equality; as they are named they must oppose each other."""
HINT = (
    "the tilt turns against the angular acceleration of the two accelerometers, and with it if they change places: are "
    "inner and outer interchanged?"
)


def interchanged(
    tilt: np.ndarray, acceleration: np.ndarray, parts: Sequence[slice], dt: float, places: RadialTilt
) -> bool:
    """Whether the data clearly say that the two accelerometers are interchanged.

    Args:
        tilt: y, (n,) [rad].
        acceleration: a, (n,) [rad/s^2].
        parts: Without a gap in between.
        dt: Sample period [s].
        places: Where they are said to be.
    """
    share = (places.r_inner + places.r_outer) / STANDARD_GRAVITY * acceleration * np.cos(tilt)
    as_named = _agreement(tilt, acceleration, parts, dt)
    turned = _agreement(tilt - np.arcsin(np.clip(share, -1.0, 1.0)), -acceleration, parts, dt)
    return as_named is not None and turned is not None and as_named < 0.0 and turned > CLEAR


def _agreement(tilt: np.ndarray, acceleration: np.ndarray, parts: Sequence[slice], dt: float) -> float | None:
    """2 sum(a b) / sum(a^2 + b^2) of the acceleration a and the tilt's second derivative b, weighted over stretches."""
    found = second_derivative_pairs(tilt, acceleration, parts, dt)
    if found is None:
        return None
    a, b = found
    size = float(np.sum(a**2 + b**2))
    return 2.0 * float(np.sum(a * b)) / size if size > 0.0 else None
