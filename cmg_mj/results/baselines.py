"""Baselines of every estimate of the rate: zero, a cheap gyro in three ways on the same motion, and two floors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.noise import normals
from cmg_mj.observers.mems_fused import MIN_TILT_SIGMA, RATE_START, Covariance, first_covariance, next_gains
from cmg_mj.results.floors import FLOORS
from cmg_mj.sensors.gyros import MemsGyro

ZERO = "zero"
MEMS_AS_BOUGHT, MEMS_GYRO, MEMS_FUSED = "mems_as_bought", "mems_gyro", "mems_fused"
GYROS = (MEMS_AS_BOUGHT, MEMS_GYRO, MEMS_FUSED)
"""The cheap gyro as it is bought, calibrated, and as bought but fused with y1."""
RATES = (ZERO, *GYROS)
"""Baselines that give a rate at every tick."""
NO_OBSERVERS = (ZERO, MEMS_AS_BOUGHT, MEMS_GYRO)
"""Those of them that are no observers: they close no loop."""
BASELINES = (*RATES, *FLOORS)
"""Names of all baselines, in the order of every table."""

SETTLED = 1e-13
"""Gains that change by less from tick to tick, relative, are taken to be constant."""


class FusedGyro:
    """The observer `mems_fused` open loop, for many ticks at once: every run has it, and a step a tick takes longer.

    Args:
        gyro_sigma: Standard deviation of a sample of the gyro [rad/s].
        bias_instability: Floor of the gyro's Allan deviation [rad/s].
        tilt_sigmas: Standard deviation of a sample of y1 in each world [rad].
        dt: Sample period [s].
        rate_start: Standard deviation of the rate at the start [rad/s].
        bias: First estimate of the bias; None for the first reading [rad/s].
    """

    def __init__(
        self,
        gyro_sigma: float,
        bias_instability: float,
        tilt_sigmas: Sequence[float],
        dt: float,
        rate_start: float = RATE_START,
        bias: float | None = None,
    ) -> None:
        self._dt, self._bias = dt, bias
        sigmas = np.maximum(tilt_sigmas, MIN_TILT_SIGMA)
        alike = bool((sigmas == sigmas[0]).all())
        self._R: Scalar = float(sigmas[0]) ** 2 if alike else sigmas * sigmas
        self._gyro_sigma, self._walk = gyro_sigma, bias_instability
        self.covariance: Covariance = first_covariance(self._R, gyro_sigma, rate_start)
        self._gains: list[tuple[Scalar, Scalar]] = []
        self._is_settled = False
        self._turned = self._reading = self._x1 = self._turn = np.zeros(len(sigmas))

    def rates(self, reading: np.ndarray, y1: np.ndarray) -> np.ndarray:
        """Estimate the rate at the next ticks.

        Args:
            reading: What the gyro shows, (n_rows, n_worlds) [rad/s].
            y1: Measured tilt, (n_rows, n_worlds) [rad].

        Returns:
            The rate, (n_rows, n_worlds) [rad/s].
        """
        start = not self._gains
        if start:
            self._reading = reading[0]
            self._turn = self._dt * (reading[0] if self._bias is None else np.full_like(reading[0], self._bias))
        before = np.vstack([self._reading, reading[:-1]])
        turns = 0.5 * self._dt * (before + reading)
        if start:
            turns[0] = 0.0
        turned = np.cumsum(np.vstack([self._turned, turns]), axis=0)[1:]
        self._reading, self._turned = reading[-1], turned[-1]
        biases = self._filter(y1 - turned, self._next_gains(len(reading)))
        return reading - biases / self._dt

    def _filter(self, seen: np.ndarray, gains: Sequence[tuple[Scalar, Scalar]]) -> np.ndarray:
        """Filter y1 less what the gyro has turned since the start: it falls by a bias a tick, of which it returns all.

        `self._x1` is the estimate of what is seen, `self._turn` the bias times the sample period.
        """
        single = seen.shape[1] == 1 and isinstance(self._R, float)
        samples = seen[:, 0].tolist() if single else seen  # a float costs a twentieth of an array of one
        x1, turn = (self._x1.item(), self._turn.item()) if single else (self._x1, self._turn)
        turns = []
        for sample, (k1, k2) in zip(samples, gains, strict=True):
            x1 = x1 - turn
            e = sample - x1
            x1 = x1 + k1 * e
            turn = turn + k2 * e
            turns.append(turn)
        self._x1, self._turn = np.atleast_1d(x1), np.atleast_1d(turn)
        return np.array(turns).reshape(seen.shape)

    def _next_gains(self, n: int) -> Sequence[tuple[Scalar, Scalar]]:
        """Compute the gains of the next n samples on x1 and on the bias times the sample period.

        At the very first one x1 is what is measured, and the bias stays.
        """
        if self._is_settled:
            return self._gains[-1:] * n
        gains: list[tuple[Scalar, Scalar]] = [] if self._gains else [(1.0, 0.0)]
        for _ in range(n - len(gains)):
            k1, k2, self.covariance = next_gains(self.covariance, self._R, self._dt, self._gyro_sigma, self._walk)
            gains.append((k1, self._dt * k2))
        self._gains = gains
        if n > 1:
            changes = [abs(b - a) <= SETTLED * abs(b) for a, b in zip(gains[-2], gains[-1], strict=True)]
            self._is_settled = bool(np.all(changes[0]) and np.all(changes[1]))
        return gains


class Baselines:
    """Baselines that give a rate from the frame's own. They close no loop.

    Args:
        gyro: The gyro.
        dt: Control period [s].
        seed: Seed of the sensors' noise.
        world_ids: The number of one world, or the numbers of many: the gyro's noise depends on (seed, number) alone.
        tilt_sigmas: Standard deviation of y1 at a tick in each world [rad].
        axis: The number of the axis: each has a gyro of its own.
    """

    def __init__(
        self,
        gyro: MemsGyro,
        dt: float,
        seed: int,
        world_ids: int | Sequence[int],
        tilt_sigmas: Sequence[float],
        axis: int = 0,
    ) -> None:
        self._read = gyro.started(dt, lambda stream, channels: normals(seed, world_ids, stream.on_axis(axis), channels))
        self._is_calibrated = gyro.reading == "calibrated"
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
        fused = self._fused.rates(calibrated if self._is_calibrated else as_bought, y1)
        return {ZERO: np.zeros_like(body_rate), MEMS_AS_BOUGHT: as_bought, MEMS_GYRO: calibrated, MEMS_FUSED: fused}
