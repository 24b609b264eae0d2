"""Trajectory -> numbers, piece by piece, so that a batch need not keep its trajectories."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cmg_mj.results.error_bounds import Floors
from cmg_mj.scenario.disturbances import Push, inside, push_windows
from cmg_mj.scenario.schema import MetricsSettings


class Metrics:
    """Running sums over the ticks of one or many worlds. Rows that are NaN (after a world's end) do not count.

    Args:
        observers: The observer in the loop, then the open-loop observers.
        n_worlds: How many worlds.
        dt: Control period [s].
        pushes: Torques from outside.
        rate_limit: Largest gimbal rate [rad/s].
        settings: The settle band, and from when on a bias estimate is judged.
        targets: Extra signal -> what an observer that estimates it should find in each world, (n_worlds,); in rad.
        references: Names of what the estimates are judged beside.
        floors: What no estimate can go below.
    """

    def __init__(
        self,
        observers: Sequence[str],
        n_worlds: int,
        dt: float,
        pushes: Sequence[Push],
        rate_limit: float,
        settings: MetricsSettings,
        targets: Mapping[str, Sequence[float]] | None = None,
        references: Sequence[str] = (),
        floors: Floors | None = None,
    ) -> None:
        self.observers = list(observers)
        self.references = list(references)
        self._floors = floors
        self._dt = dt
        self._push_end = max((push.end_s for push in pushes), default=0.0)
        self._windows = push_windows(pushes)
        self._limit = rate_limit
        self._band = math.radians(settings.settle_band_deg)
        self._targets = {signal: np.array(values) for signal, values in (targets or {}).items()}
        self._judged_from = settings.bias_from_s
        # (observer, signal) -> count, sum, squared error, (3, n_worlds)
        self._found: dict[tuple[str, str], np.ndarray] = {}
        self._ticks = 0
        self._count = np.zeros(n_worlds)
        self._push_count = np.zeros(n_worlds)
        self._squares = {name: np.zeros(n_worlds) for name in ("tilt", "velocity", "velocity_push", "command")}
        judged = (*observers, *references)
        self._errors = {name: np.zeros(n_worlds) for name in judged}
        self._fog_errors = {name: np.zeros(n_worlds) for name in judged}
        self._push_errors = {name: np.zeros(n_worlds) for name in judged}
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
        estimates: Sequence[Mapping[str, np.ndarray]],
        references: Mapping[str, np.ndarray] | None = None,
        y1: np.ndarray | None = None,
    ) -> None:
        """Add the next ticks.

        Args:
            x1: True tilt, (n_rows, n_worlds) [rad].
            x2: True tilt rate, (n_rows, n_worlds) [rad/s].
            x3: True gimbal angle, (n_rows, n_worlds) [rad].
            u: Command, (n_rows, n_worlds) [rad/s].
            fog: The gyro's rate, (n_rows, n_worlds) [rad/s].
            estimates: Each observer's estimates by their names, `x2_rad_s` among them, (n_rows, n_worlds).
            references: Each reference's tilt rate, (n_rows, n_worlds) [rad/s].
            y1: Measured tilt, for the floors, (n_rows, n_worlds) [rad].
        """
        counted = np.isfinite(x1)
        tick = self._ticks + np.arange(len(x1))[:, None]
        self._ticks += len(x1)
        self._count += counted.sum(axis=0)
        self._squares["tilt"] += _sum_of_squares(x1, counted)
        self._squares["velocity"] += _sum_of_squares(x2, counted)
        self._squares["command"] += _sum_of_squares(u, counted)
        pushed = counted & inside(tick * self._dt, self._windows)
        self._push_count += pushed.sum(axis=0)
        self._squares["velocity_push"] += _sum_of_squares(x2, pushed)
        if self._floors and y1 is not None:
            self._floors.add(y1, x2, counted, pushed)
        rates = {name: estimate["x2_rad_s"] for name, estimate in zip(self.observers, estimates, strict=True)}
        for name, rate in (rates | dict(references or {})).items():
            self._errors[name] += _sum_of_squares(rate - x2, counted)
            self._fog_errors[name] += _sum_of_squares(rate - fog, counted)
            self._push_errors[name] += _sum_of_squares(rate - x2, pushed)
        judged = counted & (tick * self._dt >= self._judged_from - 1e-9)
        for name, estimate in zip(self.observers, estimates, strict=True):
            for signal in self._targets.keys() & estimate.keys():
                self._add_found(name, signal, estimate[signal], judged)
        self._saturated += (counted & (np.abs(u) >= self._limit)).sum(axis=0)
        self._gimbal_peak = np.maximum(self._gimbal_peak, np.where(counted, np.abs(x3), 0.0).max(axis=0, initial=0.0))
        outside = counted & (np.abs(x1) > self._band)
        self._last_outside = np.maximum(self._last_outside, np.where(outside, tick, -1).max(axis=0, initial=-1))
        self._last_tick = np.maximum(self._last_tick, np.where(counted, tick, -1).max(axis=0, initial=-1))

    def _add_found(self, name: str, signal: str, values: np.ndarray, judged: np.ndarray) -> None:
        sums = self._found.setdefault((name, signal), np.zeros((3, len(self._count))))
        sums[0] += judged.sum(axis=0)
        sums[1] += _sum(values, judged)
        sums[2] += _sum_of_squares(values - self._targets[signal], judged)

    def _found_summary(self, name: str, world: int) -> dict[str, float | None]:
        """Of each signal what was to be found, the mean estimate and its RMS error; None if the run ended too early."""
        summary = {}
        for (observer, signal), sums in self._found.items():
            if observer == name:
                n, total, squares = sums[:, world]
                what = signal.removesuffix("_rad")
                summary |= {
                    f"{what}_deg": math.degrees(self._targets[signal][world]),
                    f"{what}_estimate_deg": _number(math.degrees(total / n)) if n else None,
                    f"{what}_rms_error_deg": _number(math.degrees(math.sqrt(squares / n))) if n else None,
                }
        return summary

    def summary(self, world: int, stood: bool) -> dict[str, Any]:
        """The numbers of one world.

        Args:
            world: Its index.
            stood: Whether it stood to the end; otherwise it never settled.

        Returns:
            Values by the names that `--json` prints; None where there is no such number.
        """
        n = self._count[world]
        tilt, command = (_rms(self._squares[name][world], n) for name in ("tilt", "command"))
        loop = self.observers[0]
        open_loop_observers = {
            name: {**self._rate_summary(name, world), **self._found_summary(name, world)} for name in self.observers[1:]
        }
        references = {name: self._rate_summary(name, world) for name in self.references}
        floors = self._floors.errors(world) if self._floors else {}
        references |= {name: self._figures(world, *errors) for name, errors in floors.items()}
        return {
            "settle_time_s": self._settle_time(world, stood),
            **self._rate_summary(loop, world),
            "tilt_rms_deg": None if tilt is None else math.degrees(tilt),
            "gimbal_peak_deg": math.degrees(self._gimbal_peak[world]) if n else None,
            "command_rms_rad_s": command,
            "command_saturated_fraction": float(self._saturated[world] / n) if n else None,
            **self._found_summary(loop, world),
            **({"open_loop_observers": open_loop_observers} if open_loop_observers else {}),
            **({"references": references} if references else {}),
        }

    def _rate_summary(self, name: str, world: int) -> dict[str, float | None]:
        """How well the true rate was estimated, over the whole run and in the push windows."""
        n, n_push = self._count[world], self._push_count[world]
        error, push_error = _rms(self._errors[name][world], n), _rms(self._push_errors[name][world], n_push)
        return self._figures(world, error, push_error, _rms(self._fog_errors[name][world], n))

    def _figures(
        self, world: int, error: float | None, push_error: float | None, fog_error: float | None = None
    ) -> dict[str, float | None]:
        """The errors beside the motion."""
        n, n_push = self._count[world], self._push_count[world]
        motion = _rms(self._squares["velocity"][world], n)
        push_motion = _rms(self._squares["velocity_push"][world], n_push)
        return {
            "velocity_rms_error_rad_s": error,
            "velocity_rms_error_fog_rad_s": fog_error,
            "velocity_rms_error_push_rad_s": push_error if n_push else None,
            "velocity_rms_rad_s": motion,
            "velocity_fit": _fit(error, motion),
            "velocity_fit_push": _fit(push_error, push_motion),
        }

    def _settle_time(self, world: int, stood: bool) -> float | None:
        """From the end of the last push until |x1| stays inside the band to the end [s]; None if it does not."""
        end = float(self._last_tick[world] * self._dt)
        first_inside = float((self._last_outside[world] + 1) * self._dt)
        if not stood or self._last_tick[world] < 0 or first_inside > end + 1e-9 or end < self._push_end:
            return None
        return max(0.0, first_inside - self._push_end)


def _sum(values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Of each world, in an order of its own: a world of many sums to the last bit as it does alone."""
    return np.where(counted, values, 0.0).T.copy().sum(axis=1)


def _sum_of_squares(values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    return _sum(values * values, counted)


def _rms(total: float, n: float) -> float | None:
    """Root of the mean square of n numbers; None of none, or if one was not finite."""
    return _number(math.sqrt(total / n)) if n else None


def _fit(error: float | None, motion: float | None) -> float | None:
    """That of system identification, 1 - error/motion: 1 is the truth, 0 an estimate of zero."""
    return _number(1.0 - error / motion) if motion and error is not None else None


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
