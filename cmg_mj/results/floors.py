"""Lower bounds (floors) on the error of a rate estimate: from y1 alone, and from y1 with its acceleration.

They are for the sensors' noise alone: offsets, other errors of the sensors and a pivot that moves are not in them.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import numpy as np

from cmg_mj.core.tilt import MeasurementNoise

FLOOR_Y1, FLOOR_ACCELERATION = "floor_y1", "floor_accel"
FLOORS = (FLOOR_Y1, FLOOR_ACCELERATION)
"""Names of the floors, in the order of every table."""
NOISE_ALONE = "Floors are for the sensors' noise alone: no other error of theirs, and a pivot at rest."
"""Said wherever they are printed."""
NO_ACCELERATION_FLOOR = (
    "No floor_accel: it is for the sensors' noise alone and a pivot at rest.\nfloor_y1 has all errors of y1 in it."
)
"""Said where a pivot moves, or accelerometers vibrate or are off their radii."""

MEMORY_S = 0.5
"""Memory of the filters of y1 that are tried for its floor [s]."""
SINGLE, WIDER = 4, 1.3
"""Number of newest samples with a tap each, and the factor by which the taps of older samples widen.
A tap a sample lowers the floor of a whole run of 15 s by 0.3 to 0.8 %, 200 taps over a second by 2 to 4 %. About 3 %
are due to their number alone: 200 taps fit this share of the noise in a world's 3,000 samples
(docs/studies/gyro_free.py --parts taps)."""
PIECE = 16
"""Worlds whose sums are taken together: so many stay in a processor's cache."""
ROWS_A_TAP = 10
"""Fewest samples for each tap of a fit."""


@lru_cache(maxsize=256)
def acceleration_floor(noise: MeasurementNoise, dt: float) -> float:
    """Compute the least RMS error of a filter of y1 and its acceleration that must serve for any motion.

    The acceleration runs straight between samples, and nothing else is known of the motion. Then only the noise is
    left of the error: with (v, n) the noise of y1 and of the acceleration, v = c n + v', it obeys, driven by each
    sample's n, which is white (it is not behind the part's low-pass: there this is no floor),

        x1+ = x1 + dt x2 - dt^2 (2 n + n+)/6,  x2+ = x2 - dt (n + n+)/2,  y1 = x1 + c n + v',

    and the stationary Kalman filter of it is the best there is. Not only of the linear ones, if the noise is Gaussian.

    Args:
        noise: Noise of one sample.
        dt: Sample period [s].

    Returns:
        The error after each measurement, once the filter has settled [rad/s].
    """
    from scipy.linalg import solve_discrete_are

    if not (noise.tilt and noise.acceleration):
        return 0.0
    # In units of the tilt's noise and of the sample period: nothing is very large or small.
    a, c = noise.acceleration * dt * dt / noise.tilt, noise.correlation
    F = np.array([[1.0, 1.0, -a / 3.0], [0.0, 1.0, -a / 2.0], [0.0, 0.0, 0.0]])  # of x1, x2, n
    gain = np.array([[-a / 6.0], [-a / 2.0], [1.0]])
    C, R = np.array([[1.0, 0.0, c]]), np.array([[1.0 - c * c]])
    P = solve_discrete_are(F.T, C.T, gain @ gain.T, R)
    after = P - P @ C.T @ np.linalg.solve(C @ P @ C.T + R, C @ P)
    return math.sqrt(max(after[1, 1], 0.0)) * noise.tilt / dt


class TiltFloor:
    """The best causal linear filter of y1 alone, found afterwards: by least squares to the true rate itself.

    Without a model y1 gives no bound, unless the motions are known. This filter knows more than any observer can: the
    true rate in the very world that is judged. No time-invariant linear filter of y1 with
    its taps (16 over 0.5 s at 200 Hz), started at rest, has a smaller error there, however it is tuned. Filters with
    more taps, or that vary with time, may have. The whole run and the push windows have a filter each. One filter for
    all of 20 worlds has an error 1 % larger over the whole run of push_recovery, and 6 % in the push window: so much is
    fitted to the one world's noise.

    Args:
        dt: Sample period [s].
        n_worlds: How many worlds.
    """

    def __init__(self, dt: float, n_worlds: int) -> None:
        self.edges = _edges(max(1, round(MEMORY_S / dt)))
        self._taps = len(self.edges) - 1
        # Sums of all products of the taps' inputs and the true rate, in the whole run and in the push windows.
        self._products = np.zeros((2, n_worlds, self._taps + 1, self._taps + 1))
        self._counts = np.zeros((2, n_worlds))
        self._past: np.ndarray | None = None

    def add(self, y1: np.ndarray, x2: np.ndarray, counted: np.ndarray, pushed: np.ndarray) -> None:
        """Take the next ticks.

        Args:
            y1: Measured tilt, (n_rows, n_worlds) [rad].
            x2: True tilt rate, (n_rows, n_worlds) [rad/s].
            counted: Which of these count, (n_rows, n_worlds).
            pushed: Which count in the push windows, (n_rows, n_worlds).
        """
        if self._past is None:  # it stood still before
            self._past = np.repeat(y1[:1].T, self.edges[-1] - 1, axis=1)
        whole = np.concatenate([self._past, y1.T], axis=1)
        self._past = whole[:, len(y1) :].copy()
        masks = [(mask, mask.any(axis=1), mask.all()) for mask in (counted, pushed)]
        for first in range(0, len(whole), PIECE):
            worlds = slice(first, first + PIECE)
            inputs = self._inputs(whole[worlds], x2[:, worlds])
            for part, (mask, rows, everywhere) in enumerate(masks):
                if not rows.any():
                    continue
                selected = inputs if everywhere else np.where(mask[rows, worlds].T[:, None], inputs[:, :, rows], 0.0)
                # Not by @: BLAS would take every core for it, and keep them busy for a while.
                self._products[part, worlds] += np.einsum("wir,wjr->wij", selected, selected)
        for part, (mask, *_) in enumerate(masks):
            self._counts[part] += mask.sum(axis=0)

    def _inputs(self, y1: np.ndarray, x2: np.ndarray) -> np.ndarray:
        """Stack the taps' inputs, and the rate below: (n_worlds, taps + 1, n_rows)."""
        n_rows = len(x2)
        sums = np.cumsum(y1, axis=1)
        sums = np.concatenate([np.zeros_like(sums[:, :1]), sums], axis=1)
        last = sums.shape[1] - n_rows
        inputs = np.empty((len(y1), self._taps + 1, n_rows))
        for tap, (newer, older) in enumerate(pairwise(self.edges)):
            np.subtract(sums[:, last - newer :][:, :n_rows], sums[:, last - older :][:, :n_rows], inputs[:, tap])
        inputs[:, -1] = x2.T
        return inputs

    def errors(self, world: int) -> list[float | None]:
        """Compute the filter's error in one world.

        Args:
            world: Its index.

        Returns:
            RMS error in the whole run and in the push windows [rad/s]; None where there are too few samples for a fit.
        """
        errors: list[float | None] = []
        for products, count in zip(self._products[:, world], self._counts[:, world], strict=True):
            if count < ROWS_A_TAP * self._taps or not np.isfinite(products).all():
                errors.append(None)
                continue
            taps = np.linalg.lstsq(products[:-1, :-1], products[:-1, -1], rcond=1e-13)[0]
            residual = np.append(taps, -1.0)
            errors.append(math.sqrt(max(residual @ products @ residual, 0.0) / count))
        return errors


def _edges(memory: int) -> list[int]:
    """Choose the samples back between which each tap lies: the newest samples have a tap each."""
    edges, width = list(range(min(SINGLE, memory) + 1)), 1.0
    while edges[-1] < memory:
        width *= WIDER
        edges.append(min(memory, edges[-1] + round(width)))
    return edges
