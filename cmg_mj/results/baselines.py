"""Baselines of every estimate of the rate: zero, a cheap gyro in three ways on the same motion, and two floors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmg_mj.core.noise import NoiseStream, normals
from cmg_mj.results.error_bounds import FLOORS
from cmg_mj.results.fused_gyro import FusedGyro
from cmg_mj.sensors.mems_gyro import MemsGyro

ZERO = "zero"
MEMS_AS_BOUGHT, MEMS_GYRO, MEMS_FUSED = "mems_as_bought", "mems_gyro", "mems_fused"
GYROS = (MEMS_AS_BOUGHT, MEMS_GYRO, MEMS_FUSED)
"""The cheap gyro as it is bought, calibrated, and as bought but fused with y1."""
RATES = (ZERO, *GYROS)
"""Baselines that give a rate at every tick."""
REFERENCES = (*RATES, *FLOORS)
"""Names of all baselines, in the order of every table."""


class References:
    """Baselines that give a rate from the frame's own. They close no loop.

    Args:
        gyro: The gyro.
        dt: Control period [s].
        seed: Seed of the sensors' noise.
        worlds: The number of one world, or the numbers of many: the gyro's noise depends on (seed, number) alone.
        tilt_sigmas: Standard deviation of y1 at a tick in each world [rad].
        axis: The number of the axis: each has a gyro of its own.
    """

    def __init__(
        self,
        gyro: MemsGyro,
        dt: float,
        seed: int,
        worlds: int | Sequence[int],
        tilt_sigmas: Sequence[float],
        axis: int = 0,
    ) -> None:
        noise = normals(seed, worlds, NoiseStream.MEMS_GYRO.on_axis(axis), gyro.channels)
        part = np.array(next(normals(seed, worlds, NoiseStream.MEMS_PART.on_axis(axis), 2))).reshape(2, -1)
        self._read = gyro.make_both(dt, noise, part)
        self._fused = FusedGyro(gyro.white_noise_sigma(dt), gyro.flicker_floor, tilt_sigmas, dt)

    def rates(self, body_rate: np.ndarray, y1: np.ndarray) -> dict[str, np.ndarray]:
        """Compute each baseline's rate at the next ticks.

        Args:
            body_rate: Rate of the frame along the tilt axis, as a perfect gyro shows it, (n_rows, n_worlds) [rad/s].
            y1: Measured tilt, (n_rows, n_worlds) [rad].

        Returns:
            Name -> rate, (n_rows, n_worlds) [rad/s].
        """
        calibrated, as_bought = self._read(body_rate)
        fused = self._fused.rates(as_bought, y1)
        return {ZERO: np.zeros_like(body_rate), MEMS_AS_BOUGHT: as_bought, MEMS_GYRO: calibrated, MEMS_FUSED: fused}
