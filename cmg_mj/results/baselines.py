"""Baselines of every estimate of the rate: zero, a cheap gyro on the same motion, and two floors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmg_mj.results.error_bounds import FLOORS
from cmg_mj.sensors.mems_gyro import MemsGyro
from cmg_mj.sensors.noise_streams import NoiseStream, normals

ZERO, MEMS_GYRO = "zero", "mems_gyro"
RATES = (ZERO, MEMS_GYRO)
"""Baselines that give a rate at every tick."""
REFERENCES = (*RATES, *FLOORS)
"""Names of all baselines, in the order of every table."""


class References:
    """Baselines that give a rate from the true one. They close no loop.

    Args:
        gyro: The gyro.
        dt: Control period [s].
        seed: Seed of the sensors' noise.
        worlds: The number of one world, or the numbers of many: the gyro's noise depends on (seed, number) alone.
        axis: The number of the axis: each has a gyro of its own.
    """

    def __init__(self, gyro: MemsGyro, dt: float, seed: int, worlds: int | Sequence[int], axis: int = 0) -> None:
        self._read = gyro.make_reading_function(
            dt, normals(seed, worlds, NoiseStream.MEMS_GYRO.on_axis(axis), gyro.channels)
        )

    def rates(self, x2: np.ndarray) -> dict[str, np.ndarray]:
        """Compute each baseline's rate at the next ticks.

        Args:
            x2: True tilt rate, (n_rows, n_worlds) [rad/s].

        Returns:
            Name -> rate, (n_rows, n_worlds) [rad/s].
        """
        return {ZERO: np.zeros_like(x2), MEMS_GYRO: self._read(x2)}
