"""The tilt's second derivative beside an angular acceleration, both weighted over the same stretches.

Of weights w = (1 - s^2)^4, which end smoothly, b = sum(y w'') and a = sum(a w): no noisy samples are subtracted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

WIDTH_S = 0.25
"""Over so long each the tilt's second derivative is taken [s]; over at least `FEWEST_SAMPLES` samples."""
FEWEST_SAMPLES = 12
FEWEST = 20
"""So many stretches there must be."""


def second_derivative_pairs(
    tilt: np.ndarray, acceleration: np.ndarray, parts: Sequence[slice], dt: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Both over the stretches of a log.

    Args:
        tilt: y, (n,) [rad].
        acceleration: a, (n,) [rad/s^2].
        parts: Without a gap in between.
        dt: Sample period [s].

    Returns:
        Weighted sums of a and of y'', (n_stretches,); None of fewer than `FEWEST` stretches.
    """
    half = max(FEWEST_SAMPLES // 2, round(WIDTH_S / 2.0 / dt))
    s = np.arange(-half, half + 1) / (half + 1.0)
    weights = (1.0 - s**2) ** 4
    second = 8.0 * (1.0 - s**2) ** 2 * (7.0 * s**2 - 1.0) / ((half + 1.0) * dt) ** 2
    second -= second.mean()
    own, derived = [], []
    for part in parts:
        if part.stop - part.start >= len(s):
            own.append(np.convolve(acceleration[part], weights, mode="valid")[::half])
            derived.append(np.convolve(tilt[part], second, mode="valid")[::half])
    a, b = (np.concatenate(rows) if rows else np.zeros(0) for rows in (own, derived))
    return (a, b) if len(a) >= FEWEST else None
