"""A log's signals behind one low-pass, which commutes with every linear equation between them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.replay.log import Channels

BELOW_HZ, BELOW_SHARE = 8.0, 0.15
"""Highest cut-off of the low-pass [Hz], and in sampling rates."""
MAX_DELAY_S = 0.1
"""Longest delay that is found [s]."""
SETTLE = 3.0
"""Time that is cut off at both ends, in periods of the cut-off."""
PER_PERIOD = 4.0
"""Times that are compared in a period of the cut-off: two are independent."""
CLEAN = 0.005
"""Largest share of noise in the angular acceleration behind the low-pass, by power: places come out too small by it."""
SEGMENT = 1024
"""Samples of a segment of Welch's spectra."""

Curve = Callable[..., np.ndarray]
"""A cubic spline: times, (n_times,) [s], and how often it is differentiated -> (n_times, ...)."""


class Signals:
    """A log's channels, low-passed, at any time from the first sample on.

    Attributes:
        channels: The log.
        below_hz: Cut-off of the low-pass [Hz].
        grid: Times of the samples, (n,) [s].
        time: Times to compare at, without the ends, (n_times,) [s].
    """

    def __init__(self, channels: Channels, below_hz: float) -> None:
        """Choose the times.

        Args:
            channels: The log.
            below_hz: Cut-off of the low-pass [Hz].
        """
        self.channels, self.below_hz = channels, below_hz
        self.grid = channels.dt * np.arange(len(next(iter(channels.values.values()))))
        edge = SETTLE / below_hz + MAX_DELAY_S
        self.time = np.arange(edge, self.grid[-1] - edge, 1.0 / (PER_PERIOD * below_hz))

    def low_pass(self, values: np.ndarray) -> np.ndarray:
        """Filter values forward and backward by Butterworth's filter of second order, (n, ...)."""
        from scipy.signal import butter, sosfiltfilt

        sections = butter(2, self.below_hz, fs=1.0 / self.channels.dt, output="sos")
        return sosfiltfilt(sections, values, axis=0)

    def curve(self, values: np.ndarray) -> Curve:
        """Low-pass values, (n, ...), and draw a curve through them."""
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.grid, self.low_pass(values))


def below(channels: Channels) -> float:
    """Find the highest cut-off behind which the angular acceleration is clean [Hz].

    White noise of the density n in a signal that is differentiated k times, a rate's once and an angle's twice, has the
    density n (2 pi f)^(2 k) at f. Its density is that of the signal's upper quarter of frequencies.

    Args:
        channels: The log.

    Raises:
        InputError: The log has neither an angle nor a rate.
    """
    values = channels.values
    if not values.keys() & {"tilt", "rate"}:
        raise InputError("--columns: name what shows the motion: tilt (an angle sensor), rate (a gyro), or both")
    f, power = spectrum(values["rate" if "rate" in values else "tilt"], channels.dt)
    weight = (2.0 * math.pi * f) ** (2 if "rate" in values else 4)
    candidates = f[f <= min(BELOW_HZ, BELOW_SHARE / channels.dt)]
    kept = weight / (1.0 + (f / candidates[:, None]) ** 4) ** 2  # of the filter, forward and backward
    clean = candidates[floor(power) * kept.sum(axis=1) <= CLEAN * (kept @ power)]
    return float(clean.max(initial=candidates[:3].max()))


def spectrum(values: np.ndarray, dt: float, segment: int = SEGMENT) -> tuple[np.ndarray, np.ndarray]:
    """Return Welch's frequencies [Hz] and one-sided densities, without the frequency 0, of samples (n, ...)."""
    from scipy.signal import welch

    f, power = welch(values, 1.0 / dt, nperseg=min(segment, len(values)), axis=0)
    return f[1:], power[1:]


def floor(power: np.ndarray) -> np.ndarray:
    """Return the median density of the upper quarter of frequencies, (n_frequencies, ...) -> (...)."""
    return np.median(power[3 * len(power) // 4 :], axis=0)
