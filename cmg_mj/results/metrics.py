"""Numbers of a run, summed block by block: a batch need not keep its trajectories."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.results.floors import Floors
from cmg_mj.results.summary_keys import Figures, Summary
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.stages.push import Push, inside, push_windows


class TickBlock(NamedTuple):
    """Successive ticks as columns, (n_ticks, n_worlds) each.

    Attributes:
        x1: True tilt [rad].
        x2: True tilt rate [rad/s].
        body_rate: Rate of the frame along the tilt axis, as a perfect gyro on it shows [rad/s].
        x3: True gimbal angle [rad].
        y1: Measured tilt [rad].
        fog: The gyro's rate [rad/s].
        u: Command [rad/s].
        estimates: Signal -> values, for the observer in the loop and each open-loop observer; `x2_rad_s` among them.
        columns: The trajectory's columns after its time, by name.
        ended: Which worlds have ended; None for one world.
    """

    x1: np.ndarray
    x2: np.ndarray
    body_rate: np.ndarray
    x3: np.ndarray
    y1: np.ndarray
    fog: np.ndarray
    u: np.ndarray
    estimates: list[dict[str, np.ndarray]]
    columns: dict[str, np.ndarray]
    ended: np.ndarray | None


class ErrorSums:
    """Squared errors of one estimate of the tilt rate, summed over the ticks of each world.

    Attributes:
        whole: Against the true rate, over the whole run, (n_worlds,).
        gyro: Against the gyro's rate, over the whole run, (n_worlds,).
        push: Against the true rate, in the push windows, (n_worlds,).
    """

    def __init__(self, n_worlds: int) -> None:
        self.whole, self.gyro, self.push = (np.zeros(n_worlds) for _ in range(3))

    def add(self, rate: np.ndarray, block: TickBlock, counted: np.ndarray, pushed: np.ndarray) -> None:
        """Add the next ticks: the estimated rate and which of the ticks count, (n_ticks, n_worlds) each."""
        self.whole += _sum_of_squares(rate - block.x2, counted)
        self.gyro += _sum_of_squares(rate - block.fog, counted)
        self.push += _sum_of_squares(rate - block.x2, pushed)


class Metrics:
    """Running sums over the ticks of one or many worlds. Rows that are NaN (after a world's end) do not count.

    Args:
        observers: The observer in the loop, then the open-loop observers.
        n_worlds: How many worlds.
        dt: Control period [s].
        pushes: Torques from outside.
        rate_limit: Largest gimbal rate [rad/s].
        settings: The settle band, and from when on a bias estimate is judged.
        targets: Extra signal -> its true value in each world, (n_worlds,) [rad].
        references: Names of the baselines.
        floors: Lower bounds on the error.
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
        self._bias_from = settings.bias_from_s
        # observer -> signal -> count, sum, squared error, (3, n_worlds)
        self._signals: dict[str, dict[str, np.ndarray]] = {name: {} for name in observers}
        self._ticks = 0
        self._count = np.zeros(n_worlds)
        self._push_count = np.zeros(n_worlds)
        self._squares = {name: np.zeros(n_worlds) for name in ("tilt", "velocity", "velocity_push", "command")}
        self._errors = {name: ErrorSums(n_worlds) for name in (*observers, *references)}
        self._saturated = np.zeros(n_worlds)
        self._gimbal_peak = np.zeros(n_worlds)
        self._last_outside = np.full(n_worlds, -1)
        self._last_tick = np.full(n_worlds, -1)

    def update(self, block: TickBlock, references: Mapping[str, np.ndarray] | None = None) -> None:
        """Add the next ticks.

        Args:
            block: The ticks.
            references: Each baseline's tilt rate, (n_ticks, n_worlds) [rad/s].
        """
        counted = np.isfinite(block.x1)
        tick = self._ticks + np.arange(len(counted))[:, None]
        self._ticks += len(counted)
        self._count += counted.sum(axis=0)
        self._squares["tilt"] += _sum_of_squares(block.x1, counted)
        self._squares["velocity"] += _sum_of_squares(block.x2, counted)
        self._squares["command"] += _sum_of_squares(block.u, counted)
        pushed = counted & inside(tick * self._dt, self._windows)
        self._push_count += pushed.sum(axis=0)
        self._squares["velocity_push"] += _sum_of_squares(block.x2, pushed)
        if self._floors:
            self._floors.add(block.y1, block.x2, counted, pushed)
        bias_ticks = counted & (tick * self._dt >= self._bias_from - 1e-9)
        for name, estimate in zip(self.observers, block.estimates, strict=True):
            self._errors[name].add(estimate["x2_rad_s"], block, counted, pushed)
            for signal in self._targets:
                if signal in estimate:
                    self._add_signal(name, signal, estimate[signal], bias_ticks)
        for name, rate in (references or {}).items():
            self._errors[name].add(rate, block, counted, pushed)
        self._saturated += (counted & (np.abs(block.u) >= self._limit)).sum(axis=0)
        gimbal = np.where(counted, np.abs(block.x3), 0.0)
        self._gimbal_peak = np.maximum(self._gimbal_peak, gimbal.max(axis=0, initial=0.0))
        outside = counted & (np.abs(block.x1) > self._band)
        self._last_outside = np.maximum(self._last_outside, np.where(outside, tick, -1).max(axis=0, initial=-1))
        self._last_tick = np.maximum(self._last_tick, np.where(counted, tick, -1).max(axis=0, initial=-1))

    def _add_signal(self, name: str, signal: str, values: np.ndarray, ticks: np.ndarray) -> None:
        sums = self._signals[name].setdefault(signal, np.zeros((3, len(self._count))))
        sums[0] += ticks.sum(axis=0)
        sums[1] += _sum(values, ticks)
        sums[2] += _sum_of_squares(values - self._targets[signal], ticks)

    def _signal_figures(self, name: str, world: int) -> Figures:
        """Give the true value, the mean estimate and its RMS error of each signal; None if the run ended too early."""
        figures: Figures = {}
        for signal, sums in self._signals[name].items():
            n, total, squares = sums[:, world]
            label = signal.removesuffix("_rad")
            figures |= {
                f"{label}_deg": math.degrees(self._targets[signal][world]),
                f"{label}_estimate_deg": finite_or_none(math.degrees(total / n)) if n else None,
                f"{label}_rms_error_deg": finite_or_none(math.degrees(math.sqrt(squares / n))) if n else None,
            }
        return figures

    def summary(self, world: int, stood: bool) -> Summary:
        """Compute the numbers of one world.

        Args:
            world: Its index.
            stood: Whether it stood to the end; otherwise it never settled.

        Returns:
            Values by the names that `--json` prints; None where there is no such number.
        """
        n = self._count[world]
        tilt, command = (rms_of_sum(self._squares[name][world], n) for name in ("tilt", "command"))
        loop, *others = self.observers
        open_loop = {name: self._rate_figures(name, world) | self._signal_figures(name, world) for name in others}
        references = {name: self._rate_figures(name, world) for name in self.references}
        floors = self._floors.errors(world) if self._floors else {}
        references |= {name: self._error_figures(world, *errors) for name, errors in floors.items()}
        return {
            "settle_time_s": self._settle_time(world, stood),
            **self._rate_figures(loop, world),
            "tilt_rms_deg": None if tilt is None else math.degrees(tilt),
            "gimbal_peak_deg": math.degrees(self._gimbal_peak[world]) if n else None,
            "command_rms_rad_s": command,
            "command_saturated_fraction": float(self._saturated[world] / n) if n else None,
            **self._signal_figures(loop, world),
            **({"open_loop_observers": open_loop} if open_loop else {}),
            **({"references": references} if references else {}),
        }

    def _rate_figures(self, name: str, world: int) -> Figures:
        """Compute how well the true rate was estimated, over the whole run and in the push windows."""
        n, n_push, sums = self._count[world], self._push_count[world], self._errors[name]
        error, push_error = rms_of_sum(sums.whole[world], n), rms_of_sum(sums.push[world], n_push)
        return self._error_figures(world, error, push_error, rms_of_sum(sums.gyro[world], n))

    def _error_figures(
        self, world: int, error: float | None, push_error: float | None, gyro_error: float | None = None
    ) -> Figures:
        """Put errors into proportion to the motion."""
        n, n_push = self._count[world], self._push_count[world]
        motion = rms_of_sum(self._squares["velocity"][world], n)
        push_motion = rms_of_sum(self._squares["velocity_push"][world], n_push)
        return {
            "velocity_rms_error_rad_s": error,
            "velocity_rms_error_fog_rad_s": gyro_error,
            "velocity_rms_error_push_rad_s": push_error if n_push else None,
            "velocity_rms_rad_s": motion,
            "velocity_fit": fit(error, motion),
            "velocity_fit_push": fit(push_error, push_motion),
        }

    def _settle_time(self, world: int, stood: bool) -> float | None:
        """Compute the time from the last push's end until |x1| stays inside the band [s]; None if it does not."""
        end = float(self._last_tick[world] * self._dt)
        first_inside = float((self._last_outside[world] + 1) * self._dt)
        if not stood or self._last_tick[world] < 0 or first_inside > end + 1e-9 or end < self._push_end:
            return None
        return max(0.0, first_inside - self._push_end)


def _sum(values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Sum each world in an order of its own: a world of many sums to the last bit as it does alone."""
    return np.where(counted, values, 0.0).T.copy().sum(axis=1)


def _sum_of_squares(values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    return _sum(values * values, counted)


def rms_of_sum(total: float, n: float) -> float | None:
    """Compute the RMS of n numbers from the sum of their squares; None of none, or if one was not finite."""
    return finite_or_none(math.sqrt(total / n)) if n else None


def fit(error: float | None, motion: float | None) -> float | None:
    """Compute the fit of system identification, 1 - error/motion: 1 is the truth, 0 an estimate of zero."""
    return finite_or_none(1.0 - error / motion) if motion and error is not None else None


def finite_or_none(value: float) -> float | None:
    """Replace a number that JSON does not know by None."""
    return value if math.isfinite(value) else None
