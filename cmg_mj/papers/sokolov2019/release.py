"""Releases of the rig without noise: does the loop oscillate by itself, and from which lag or latency on?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019.rig import FINE, NO_NOISE, experiment, make_rig, read_servo
from cmg_mj.papers.sokolov2019.sampled_loop import Servo
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.side_by_side import BatchJob, run_side_by_side

RELEASE = (
    *NO_NOISE,
    "plant.equilibrium_bias_deg=0.0",
    "plant.initial_tilt_deg=0.2",
    "push=[]",
    "duration_s=6.0",
)
"""Let go 0.2 degrees off, nothing else disturbing it."""

WINDOW_S = 2.0
"""Two windows of this length, the last of a release, are compared."""
FLOOR_RAD_S = 1e-3
"""A tilt rate below this is no oscillation: a release begins with thirty times as much."""
STEADY = 0.98
"""Share of the amplitude that an oscillation keeps from one window to the next if it is sustained."""
LAGS_S = (0.012, 0.015, 0.017, 0.019, 0.020, 0.022, 0.025, 0.030, 0.035, 0.040, 0.045)
"""Servo lags tried, after the model's own [s]. RK4 at 1 ms forbids more than 49 ms at the model's stiffness."""
LARGEST_LATENCY_STEPS = 64
"""The largest latency tried [physics steps]."""


def is_sustained(trajectory: Trajectory, window_s: float = WINDOW_S) -> np.ndarray:
    """Find the worlds of a release that oscillate without end, grow or fall, (n_worlds,).

    Sustained: the tilt rate's peak over the last window is at least 98 % of that over the window before, and above 1e-3
    rad/s. A fall counts too.
    """
    t = trajectory["time_s"]
    x2 = np.abs(trajectory["x2_rad_s"].reshape(len(t), -1))
    middle, end = t[-1] - window_s, t[-1]
    before, last = x2[(t > middle - window_s) & (t <= middle)].max(axis=0), x2[(t > middle) & (t <= end)].max(axis=0)
    return ~np.isfinite(x2[-1]) | ((last > FLOOR_RAD_S) & (last >= STEADY * before))


def releases(servos: Mapping[str, Sequence[Servo]], settings: Sequence[str] = ()) -> dict[str, Trajectory]:
    """Let the rig go without noise, with each observer in the loop: one world a servo of its own."""
    runs = []
    for observer, observer_servos in servos.items():
        base = experiment([*RELEASE, FINE, *settings], observer)
        rigs = [replace(base, plant=make_rig(base.scenario.plant, servo)) for servo in observer_servos]
        runs.append(BatchJob(rigs, range(len(rigs))))
    results = run_side_by_side(runs)
    return {observer: trajectory_of(result) for observer, result in zip(servos, results, strict=True)}


def release(observer: str, servos: Sequence[Servo], settings: Sequence[str] = ()) -> Trajectory:
    """Let the rig go with one observer."""
    return releases({observer: servos}, settings)[observer]


class Sweep(NamedTuple):
    """Releases over the servo's lag."""

    lags_s: np.ndarray
    """(n_lags,)."""
    sustained: np.ndarray
    """True where the loop oscillates by itself, (n_lags,)."""
    amplitude_deg: np.ndarray
    """Largest tilt over the last two seconds, (n_lags,); NaN where the rig fell."""


def sweeps(observers: Sequence[str]) -> dict[str, Sweep]:
    """Release the rig with the model's servo and with slower ones, as stiff."""
    servo = read_servo(experiment().plant)
    lags = np.array([servo.lag_s, *LAGS_S])
    servos = [servo.damp(lag) for lag in lags]
    results = {}
    for observer, trajectory in releases(dict.fromkeys(observers, servos)).items():
        t, x1 = trajectory["time_s"], trajectory["x1_rad"]
        amplitude = np.degrees(np.abs(x1[t > t[-1] - WINDOW_S]).max(axis=0))
        results[observer] = Sweep(lags, is_sustained(trajectory), amplitude)
    return results


class Threshold(NamedTuple):
    """The begin of something: not yet at `low`, already at `high`; `high` is None if nowhere in the range."""

    low: float
    high: float | None

    @property
    def middle(self) -> float | None:
        """The best guess."""
        return None if self.high is None else (self.low + self.high) / 2.0


def lag_thresholds(sweep_by_observer: Mapping[str, Sweep], parts: int = 10) -> dict[str, Threshold]:
    """Find the least servo lag at which each loop oscillates by itself, to a tenth of the sweep's spacing [s]."""
    thresholds, grids = {}, {}
    for observer, sweep in sweep_by_observer.items():
        first = np.flatnonzero(sweep.sustained)
        if not len(first):
            thresholds[observer] = Threshold(float(sweep.lags_s[-1]), None)
        elif first[0] == 0:
            thresholds[observer] = Threshold(0.0, float(sweep.lags_s[0]))
        else:
            grids[observer] = np.linspace(sweep.lags_s[first[0] - 1], sweep.lags_s[first[0]], parts + 1)
    servo = read_servo(experiment().plant)
    refinements = releases({observer: [servo.damp(lag) for lag in grid[1:]] for observer, grid in grids.items()})
    for observer, grid in grids.items():
        i = int(np.argmax(is_sustained(refinements[observer])))  # the last of them is the sweep's own
        thresholds[observer] = Threshold(float(grid[i]), float(grid[i + 1]))
    return {observer: thresholds[observer] for observer in sweep_by_observer}


def latency_threshold(observer: str, largest_steps: int = LARGEST_LATENCY_STEPS) -> Threshold:
    """Find the least latency of the accelerometers at which the loop oscillates, to one physics step [s].

    They are sampled at every physics step here, so that the latency is not rounded up to control periods.
    """

    def oscillates(steps: int) -> bool:
        latency = f"sensors.accelerometer.latency_s={steps / 1000}"
        result = experiment([*RELEASE, FINE, "sensors.accelerometer.rate_hz=1000.0", latency], observer).run()
        return not result.stood.all() or bool(is_sustained(trajectory_of(result))[0])

    low, high = 0, largest_steps
    if not oscillates(high):
        return Threshold(high / 1000, None)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if oscillates(middle) else (middle, high)
    return Threshold(low / 1000, high / 1000)
