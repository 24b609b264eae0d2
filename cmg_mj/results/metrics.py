"""Numbers of a run, summed block by block: a batch need not keep its trajectories."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from cmg_mj.core.types import BIAS
from cmg_mj.results.floors import FLOOR_ACCELERATION, FLOOR_Y1, TiltFloor
from cmg_mj.results.summary_keys import Figures, Summary
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.stages.push import Push, inside, push_windows


class Metrics:
    """Running sums over the ticks of one or many worlds. Rows that are NaN (after a world's end) do not count.

    Args:
        observers: The observer in the loop, then the open-loop observers.
        n_worlds: How many worlds.
        dt: Control period [s].
        pushes: Torques from outside.
        rate_limit: Largest gimbal rate [rad/s].
        settings: The settle band, and from when on a bias estimate is judged.
        biases: True value of the signal `bias_rad` in each world, (n_worlds,) [rad].
        references: Names of the baselines.
        tilt_floor: The floor of y1 alone.
        acceleration_floors: Least error from y1 with its acceleration in each world [rad/s]; None where there is no
            such floor.
    """

    def __init__(
        self,
        observers: Sequence[str],
        n_worlds: int,
        dt: float,
        pushes: Sequence[Push],
        rate_limit: float,
        settings: MetricsSettings,
        biases: Sequence[float],
        references: Sequence[str] = (),
        tilt_floor: TiltFloor | None = None,
        acceleration_floors: Sequence[float | None] = (),
    ) -> None:
        self.observers, self.references = list(observers), list(references)
        self._tilt_floor, self._acceleration_floors = tilt_floor, acceleration_floors
        self._dt, self._limit = dt, rate_limit
        self._push_end = max((push.end_s for push in pushes), default=0.0)
        self._windows = push_windows(pushes)
        self._band = math.radians(settings.settle_band_deg)
        self._biases, self._bias_from = np.array(biases), settings.bias_from_s
        self._ticks = 0
        # What is summed, and over which ticks -> sum in each world
        self._sums: dict[tuple[str, str], np.ndarray] = defaultdict(lambda: np.zeros(n_worlds))
        # Largest gimbal angle, last tick outside the band, last tick, -1 for none -> in each world
        self._largest: dict[str, np.ndarray] = defaultdict(lambda: np.full(n_worlds, -1.0))

    def update(self, columns: Mapping[str, np.ndarray], references: Mapping[str, np.ndarray]) -> None:
        """Add the next ticks.

        Args:
            columns: The trajectory's columns after its time, by name, (n_ticks, n_worlds) each.
            references: Each baseline's tilt rate, (n_ticks, n_worlds) [rad/s].
        """
        x1, x2, u = columns["x1_rad"], columns["x2_rad_s"], columns["u_rad_s"]
        counted = np.isfinite(x1)
        tick = self._ticks + np.arange(len(counted))[:, None]
        self._ticks += len(counted)
        pushed = counted & inside(tick * self._dt, self._windows)
        bias_ticks = counted & (tick * self._dt >= self._bias_from - 1e-9)
        for part, ticks in (("run", counted), ("push", pushed), ("bias", bias_ticks)):
            self._sums["ticks", part] += ticks.sum(axis=0)
        self._sums["saturated", "run"] += (counted & (np.abs(u) >= self._limit)).sum(axis=0)
        self._add_squares("tilt", x1, run=counted)
        self._add_squares("velocity", x2, run=counted, push=pushed)
        self._add_squares("command", u, run=counted)
        if self._tilt_floor:
            self._tilt_floor.add(columns["y1_rad"], x2, counted, pushed)
        rates = {name: columns[f"estimate/{name}/x2_rad_s"] for name in self.observers}
        for name, rate in {**rates, **references}.items():
            self._add_squares(name, rate - x2, run=counted, push=pushed)
            self._add_squares(f"{name} against the gyro", rate - columns["fog_rad_s"], run=counted)
        for name in self.observers:
            estimate = columns.get(f"estimate/{name}/{BIAS}")
            if estimate is not None:
                self._sums[f"{name} bias", "sum"] += _sum(estimate, bias_ticks)
                self._add_squares(f"{name} bias", estimate - self._biases, bias=bias_ticks)
        outside = counted & (np.abs(x1) > self._band)
        for what, values, rows in (
            ("gimbal", np.abs(columns["x3_rad"]), counted),
            ("outside", tick, outside),
            ("tick", tick, counted),
        ):
            largest = np.where(rows, values, -1.0).max(axis=0, initial=-1.0)
            self._largest[what] = np.maximum(self._largest[what], largest)

    def _add_squares(self, what: str, values: np.ndarray, **ticks: np.ndarray) -> None:
        for part, counted in ticks.items():
            self._sums[what, part] += _sum(values * values, counted)

    def _rms(self, world: int, what: str, part: str = "run") -> float | None:
        """Compute an RMS from the sum of squares; None of no tick, or if one was not finite."""
        n = self._sums["ticks", part][world]
        return finite_or_none(math.sqrt(self._sums[what, part][world] / n)) if n else None

    def _bias_figures(self, name: str, world: int) -> Figures:
        """Give the true bias, its mean estimate and the RMS error, of which a run that ended too early has none."""
        if (f"{name} bias", "sum") not in self._sums:
            return {}
        n, total = self._sums["ticks", "bias"][world], self._sums[f"{name} bias", "sum"][world]
        error = self._rms(world, f"{name} bias", "bias")
        return {
            "bias_deg": math.degrees(self._biases[world]),
            "bias_estimate_deg": finite_or_none(math.degrees(total / n)) if n else None,
            "bias_rms_error_deg": None if error is None else math.degrees(error),
        }

    def summary(self, world: int, stood: bool) -> Summary:
        """Compute the numbers of one world.

        Args:
            world: Its index.
            stood: Whether it stood to the end; otherwise it never settled.

        Returns:
            Values by the names that `--json` prints; None where there is no such number.
        """
        n, tilt = self._sums["ticks", "run"][world], self._rms(world, "tilt")
        loop, *others = self.observers
        open_loop = {name: self._rate_figures(name, world) | self._bias_figures(name, world) for name in others}
        references = {name: self._rate_figures(name, world) for name in self.references}
        if self._tilt_floor:
            references[FLOOR_Y1] = self._error_figures(world, *self._tilt_floor.errors(world))
            least = self._acceleration_floors[world]
            if least is not None:
                references[FLOOR_ACCELERATION] = self._error_figures(world, least, least)
        return {
            "settle_time_s": self._settle_time(world, stood),
            **self._rate_figures(loop, world),
            "tilt_rms_deg": None if tilt is None else math.degrees(tilt),
            "gimbal_peak_deg": math.degrees(self._largest["gimbal"][world]) if n else None,
            "command_rms_rad_s": self._rms(world, "command"),
            "command_saturated_fraction": float(self._sums["saturated", "run"][world] / n) if n else None,
            **self._bias_figures(loop, world),
            **({"open_loop_observers": open_loop} if open_loop else {}),
            **({"references": references} if references else {}),
        }

    def _rate_figures(self, name: str, world: int) -> Figures:
        """Compute how well the true rate was estimated, over the whole run and in the push windows."""
        gyro_error = self._rms(world, f"{name} against the gyro")
        return self._error_figures(world, self._rms(world, name), self._rms(world, name, "push"), gyro_error)

    def _error_figures(
        self, world: int, error: float | None, push_error: float | None, gyro_error: float | None = None
    ) -> Figures:
        """Put errors into proportion to the motion."""
        motion, push_motion = self._rms(world, "velocity"), self._rms(world, "velocity", "push")
        return {
            "velocity_rms_error_rad_s": error,
            "velocity_rms_error_fog_rad_s": gyro_error,
            "velocity_rms_error_push_rad_s": None if push_motion is None else push_error,
            "velocity_rms_rad_s": motion,
            "velocity_fit": fit(error, motion),
            "velocity_fit_push": fit(push_error, push_motion),
        }

    def _settle_time(self, world: int, stood: bool) -> float | None:
        """Compute the time from the last push's end until |x1| stays inside the band [s]; None if it does not."""
        end = float(self._largest["tick"][world] * self._dt)
        first_inside = float((self._largest["outside"][world] + 1) * self._dt)
        if not stood or first_inside > end + 1e-9 or end < self._push_end:
            return None
        return max(0.0, first_inside - self._push_end)


def _sum(values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Sum each world in an order of its own: a world of many sums to the last bit as it does alone."""
    return np.where(counted, values, 0.0).T.copy().sum(axis=1)


def fit(error: float | None, motion: float | None) -> float | None:
    """Compute the fit of system identification, 1 - error/motion: 1 is the truth, 0 an estimate of zero."""
    return finite_or_none(1.0 - error / motion) if motion and error is not None else None


def finite_or_none(value: float) -> float | None:
    """Replace a number that JSON does not know by None."""
    return value if math.isfinite(value) else None
