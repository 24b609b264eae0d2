"""The low-pass inside a digital sensor: a second-order Butterworth filter at the part's own sampling rate."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from cmg_mj.elementwise import Scalar


def noise_gain(bandwidth_hz: float, rate_hz: float) -> float:
    """Return the variance of white noise after the filter, by that before.

    The bilinear transform makes |H|^2 = 1/(1 + (w/t)^4), w = tan(omega/2), t = tan(pi bandwidth/rate); its mean over
    omega, by partial fractions.

    Args:
        bandwidth_hz: Where the filter has halved the power [Hz].
        rate_hz: Of its samples [Hz].

    Returns:
        The ratio.
    """
    t = math.tan(math.pi * bandwidth_hz / rate_hz)
    return (t**4 + (t - t**3) / math.sqrt(2.0)) / (1.0 + t**4)


def low_pass(bandwidth_hz: float, rate_hz: float, start: Scalar) -> Callable[[Scalar], Scalar]:
    """Return a filter at work, which has seen the same value for ever.

    Args:
        bandwidth_hz: Where it has halved the power [Hz].
        rate_hz: Of its samples [Hz].
        start: The value (a float, or an array).

    Returns:
        A function: the next sample -> what the filter shows.
    """
    from scipy.signal import butter  # 1 s of import, which only a part with a low-pass needs

    (b0, b1, b2), (_, a1, a2) = np.array(butter(2, bandwidth_hz, fs=rate_hz)).tolist()
    first, second = (1.0 - b0) * start, (b2 - a2) * start

    def passed(x: Scalar) -> Scalar:
        nonlocal first, second
        y = b0 * x + first
        first = b1 * x - a1 * y + second
        second = b2 * x - a2 * y
        return y

    return passed
