"""Trajectory -> numbers, piece by piece, so that a batch need not keep its trajectories."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.fields import STRICT, Positive


@dataclass(frozen=True, config=STRICT)
class MetricsSettings:
    """What counts as settled and as fallen.

    Attributes:
        settle_band_deg: Settled is |x1| inside this band until the end [deg].
        fall_angle_deg: Fallen is |q_b + pi/4| beyond this angle [deg].
        bias_from_s: A bias estimate is judged from this time on, when it has had time to converge [s].
    """

    settle_band_deg: Positive = 1.0
    fall_angle_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 30.0
    bias_from_s: Annotated[float, Field(ge=0.0)] = 5.0


class Metrics:
    """Running sums over the ticks of one or many worlds. Rows that are NaN (after a world's end) do not count.

    Args:
        observers: The observer in the loop, then the companions.
        biases: What an observer of the bias should find in each world, (n_worlds,) [rad].
        dt: Control period [s].
        push_end_s: End of the last push, 0 without one [s].
        rate_limit: Largest gimbal rate [rad/s].
        settings: The settle band.
    """

    def __init__(
        self,
        observers: Sequence[str],
        biases: Sequence[float],
        dt: float,
        push_end_s: float,
        rate_limit: float,
        settings: MetricsSettings,
    ) -> None:
        self.observers = list(observers)
        self._dt = dt
        self._push_end = push_end_s
        self._limit = rate_limit
        self._band = math.radians(settings.settle_band_deg)
        n_worlds = len(biases)
        self._biases = np.array(biases)
        self._bias_from = settings.bias_from_s
        self._bias_sums: dict[str, np.ndarray] = {}  # observer -> count, sum, squared error, (3, n_worlds)
        self._ticks = 0
        self._count = np.zeros(n_worlds)
        self._squares = {name: np.zeros(n_worlds) for name in ("tilt", "command")}
        self._errors = {name: np.zeros(n_worlds) for name in observers}
        self._fog_errors = {name: np.zeros(n_worlds) for name in observers}
        self._saturated = np.zeros(n_worlds)
        self._gimbal_peak = np.zeros(n_worlds)
        self._last_outside = np.full(n_worlds, -1)
        self._last_tick = np.full(n_worlds, -1)

    def update(
        self,
        x1: np.ndarray,
        x2: np.ndarray,
        x3: np.ndarray,
        u: np.ndarray,
        fog: np.ndarray,
        rates: Sequence[np.ndarray],
    ) -> None:
        """Add the next ticks.

        Args:
            x1: True tilt, (n_rows, n_worlds) [rad].
            x2: True tilt rate, (n_rows, n_worlds) [rad/s].
            x3: True gimbal angle, (n_rows, n_worlds) [rad].
            u: Command, (n_rows, n_worlds) [rad/s].
            fog: The gyro's rate, (n_rows, n_worlds) [rad/s].
            rates: Each observer's estimate of x2, (n_rows, n_worlds) [rad/s].
        """
        counted = np.isfinite(x1)
        tick = self._ticks + np.arange(len(x1))[:, None]
        self._ticks += len(x1)
        self._count += counted.sum(axis=0)
        self._squares["tilt"] += _sum_of_squares(x1, counted)
        self._squares["command"] += _sum_of_squares(u, counted)
        for name, rate in zip(self.observers, rates, strict=True):
            self._errors[name] += _sum_of_squares(rate - x2, counted)
            self._fog_errors[name] += _sum_of_squares(rate - fog, counted)
        self._saturated += (counted & (np.abs(u) >= self._limit)).sum(axis=0)
        self._gimbal_peak = np.maximum(self._gimbal_peak, np.where(counted, np.abs(x3), 0.0).max(axis=0, initial=0.0))
        outside = counted & (np.abs(x1) > self._band)
        self._last_outside = np.maximum(self._last_outside, np.where(outside, tick, -1).max(axis=0, initial=-1))
        self._last_tick = np.maximum(self._last_tick, np.where(counted, tick, -1).max(axis=0, initial=-1))

    def update_bias(self, x1: np.ndarray, biases: Sequence[np.ndarray | None]) -> None:
        """Add the bias estimates of the ticks that `update` was just given.

        Args:
            x1: True tilt, (n_rows, n_worlds) [rad].
            biases: Each observer's estimate of e, (n_rows, n_worlds) [rad]; None for one that has none.
        """
        tick = self._ticks - len(x1) + np.arange(len(x1))[:, None]
        counted = np.isfinite(x1) & (tick * self._dt >= self._bias_from - 1e-9)
        for name, bias in zip(self.observers, biases, strict=True):
            if bias is not None:
                sums = self._bias_sums.setdefault(name, np.zeros((3, len(self._biases))))
                sums[0] += counted.sum(axis=0)
                sums[1] += np.where(counted, bias, 0.0).sum(axis=0)
                sums[2] += _sum_of_squares(bias - self._biases, counted)

    def _bias_summary(self, name: str, world: int) -> dict[str, float | None]:
        """What was to be found, the mean estimate and its RMS error; None for these if the run ended too early."""
        if name not in self._bias_sums:
            return {}
        n, total, squares = self._bias_sums[name][:, world]
        return {
            "bias_deg": math.degrees(self._biases[world]),
            "bias_estimate_deg": _number(math.degrees(total / n)) if n else None,
            "bias_rms_error_deg": _number(math.degrees(math.sqrt(squares / n))) if n else None,
        }

    def summary(self, world: int, fell: bool) -> dict[str, Any]:
        """The numbers of one world.

        Args:
            world: Its index.
            fell: Whether it fell: then it never settled.

        Returns:
            Values by the names that `--json` prints; None where there is no such number.
        """
        n = self._count[world]

        def rms(total: np.ndarray) -> float | None:
            return _number(math.sqrt(total[world] / n)) if n else None

        tilt = rms(self._squares["tilt"])
        loop = self.observers[0]
        companions = {
            name: {
                "velocity_rms_error_rad_s": rms(self._errors[name]),
                "velocity_rms_error_fog_rad_s": rms(self._fog_errors[name]),
                **self._bias_summary(name, world),
            }
            for name in self.observers[1:]
        }
        return {
            "settle_time_s": self._settle_time(world, fell),
            "velocity_rms_error_rad_s": rms(self._errors[loop]),
            "velocity_rms_error_fog_rad_s": rms(self._fog_errors[loop]),
            "tilt_rms_deg": None if tilt is None else math.degrees(tilt),
            "gimbal_peak_deg": math.degrees(self._gimbal_peak[world]) if n else None,
            "command_rms_rad_s": rms(self._squares["command"]),
            "command_saturated_fraction": float(self._saturated[world] / n) if n else None,
            **self._bias_summary(loop, world),
            **({"companions": companions} if companions else {}),
        }

    def _settle_time(self, world: int, fell: bool) -> float | None:
        """From the end of the last push until |x1| stays inside the band to the end [s]; None if it does not."""
        end = float(self._last_tick[world] * self._dt)
        first_inside = float((self._last_outside[world] + 1) * self._dt)
        if fell or self._last_tick[world] < 0 or first_inside > end + 1e-9 or end < self._push_end:
            return None
        return max(0.0, first_inside - self._push_end)


def _sum_of_squares(values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    return np.square(np.where(counted, values, 0.0)).sum(axis=0)


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
