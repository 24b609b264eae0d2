"""1/f noise, whose Allan deviation has a floor: what datasheets call bias instability."""

from __future__ import annotations

import math

import numpy as np

CORNERS_HZ = (0.01, 0.1, 1.0, 10.0)
"""Corner frequencies of the Gauss-Markov processes whose sum is the 1/f noise: one a decade, so it waves by 6 %.
Above 15 Hz the white noise of a part that costs a few dollars is the larger."""


def spread_of(floor: float) -> float:
    """Standard deviation of each Gauss-Markov process.

    1/f noise of one-sided density K^2/f has an Allan deviation of K sqrt(2 ln 2) whatever is averaged over;
    processes of variance v with corners a factor r apart sum to K^2 = v/ln r.

    Args:
        floor: Of the Allan deviation, in the reading's unit.

    Returns:
        In the reading's unit.
    """
    k = floor / math.sqrt(2.0 * math.log(2.0))
    return k * math.sqrt(math.log(CORNERS_HZ[1] / CORNERS_HZ[0]))


class Flicker:
    """1/f noise at work, as if it had been on for ever.

    Args:
        floor: Of the Allan deviation, in the reading's unit.
        dt: Sample period [s].
        normals: Standard normals that it starts from, a row a corner, (len(CORNERS_HZ), ...).
    """

    def __init__(self, floor: float, dt: float, normals: np.ndarray) -> None:
        sigma = spread_of(floor)
        decay = np.exp(-2.0 * math.pi * np.array(CORNERS_HZ) * dt)
        self._decay = decay.reshape(-1, *[1] * (normals.ndim - 1))
        self._spread = sigma * np.sqrt(1.0 - self._decay**2)
        self._wander = sigma * normals

    def advance(self, normals: np.ndarray) -> np.ndarray:
        """Return the noise of the next samples.

        Args:
            normals: Standard normals, (n, len(CORNERS_HZ), ...).

        Returns:
            (n, ...), in the reading's unit.
        """
        driven = self._spread * normals
        for row in driven:
            row += self._decay * self._wander
            self._wander = row
        return driven.sum(axis=1)
