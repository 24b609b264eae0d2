"""The cycle of the linearised, sampled loop behind a gap, by its describing function."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from cmg_mj.papers.sokolov2019.backlash import GAP_ARCMIN
from cmg_mj.papers.sokolov2019.lag import linearise
from cmg_mj.stages.backlash import ARCMIN_A_DEGREE


class PredictedCycle(NamedTuple):
    """A cycle of the linear loop with the gap."""

    amplitude_deg: float
    """Amplitude of the tilt [deg]."""
    frequency_hz: float


def describing_function(c: float) -> complex:
    """Return the fundamental of the gimbal's angle by that of the motor's, a sine, behind a gap.

    Args:
        c: gap/A - 1, with A the motor's amplitude: -1 without a gap, 1 where the motor only just crosses it.
    """
    root = math.sqrt(max(1.0 - c * c, 0.0))
    return complex(0.5 - (math.asin(c) + c * root) / math.pi, -root * root / math.pi)


def predict_cycle(observer: str, points: int = 60) -> PredictedCycle | None:
    """Return the largest motion that neither grows nor decays, of which larger ones decay and smaller ones grow.

    Args:
        observer: A linear one, in the loop.
        points: Number of points of the grid.

    Returns:
        The cycle; None if there is none.
    """
    loop, servo, dt = linearise(observer)

    def turning(c: float) -> tuple[complex, np.ndarray]:
        """Return the least damped motion that turns forward faster than 1 rad/s: its factor a period, its shape."""
        factors, shapes = np.linalg.eig(loop(servo, share=describing_function(c)))
        forward = np.angle(factors) > dt
        index = int(np.argmax(np.where(forward, np.abs(factors), 0.0)))
        return complex(factors[index]), shapes[:, index]

    def growth(c: float) -> float:
        return math.log(abs(turning(c)[0])) / dt

    grid = np.linspace(-1.0, 0.98, points)
    rates = [growth(float(c)) for c in grid]
    first = next((i for i in range(1, points) if rates[i - 1] < 0.0 <= rates[i]), None)
    if first is None:
        return None
    c = float(brentq(growth, grid[first - 1], grid[first], xtol=1e-9))  # type: ignore[arg-type]
    factor, shape = turning(c)
    rate = math.atan2(factor.imag, factor.real) / dt
    motor = math.radians(GAP_ARCMIN / ARCMIN_A_DEGREE) / (1.0 + c)
    return PredictedCycle(math.degrees(motor * rate * float(abs(shape[0]) / abs(shape[-1]))), rate / (2.0 * math.pi))
