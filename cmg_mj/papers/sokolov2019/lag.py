"""Section V: which lag makes the loop oscillate by itself: on MuJoCo, and by the eigenvalues of the sampled loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from cmg_mj.laws import StateFeedback
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.rig import FINE, NO_NOISE, estimator, experiment, make_rig, read_servo
from cmg_mj.papers.sokolov2019.sampled_loop import Servo, first_crossing, modes, oscillation, period_map
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment
from cmg_mj.runs.side_by_side import BatchJob, run_side_by_side
from cmg_mj.view.plots.figure import Line, Panel, Picture

LARGEST_S = 0.12
"""Lags are searched up to here in the linearised loop [s]."""


class Prediction(NamedTuple):
    """One observer in the linearised, sampled loop; None for an event that is not in the range searched."""

    servo_lag_s: float | None
    """The least servo lag at which it oscillates, as stiff."""
    softened_lag_s: float | None
    """The least servo lag of a critically damped servo that is less stiff."""
    latency_s: float | None
    """The least latency of y1, in whole physics steps."""
    pole: complex
    """Pole of its least damped oscillation with the model's servo [1/s]."""

    @property
    def damping(self) -> float:
        """Damping ratio of that oscillation."""
        return -self.pole.real / abs(self.pole)

    @property
    def frequency_hz(self) -> float:
        """Frequency of that oscillation [Hz]."""
        return self.pole.imag / (2.0 * np.pi)


Loop = Callable[..., np.ndarray]
"""(servo, age_steps=0, share=1.0) -> the map of a control period."""


@cache
def _rig() -> Experiment:
    """Prepare the rig with the physics step of the releases, in which latencies are counted."""
    return experiment([FINE])


def linearise(observer: str | None, **parameters: float) -> tuple[Loop, Servo, float]:
    """Linearise the sampled loop with an observer, or with the true rate (None); parameters differ from Table II's."""
    prepared = _rig()
    plant, law = prepared.plant, prepared.law
    assert isinstance(law, StateFeedback)
    o = None if observer is None else estimator(observer, prepared, **parameters)

    def loop(servo: Servo, age_steps: int = 0, share: complex = 1.0) -> np.ndarray:
        step = plant.model.opt.timestep
        return period_map(plant.reduced, servo, o, law, timestep=step, age_steps=age_steps, share=share)

    return loop, read_servo(plant), law.dt


def predict(observer: str | None) -> Prediction:
    """Predict the linearised loop's behaviour with a linear observer, or with the true rate (None)."""
    loop, servo, dt = linearise(observer)

    def growth(changed_servo: Servo, age_steps: int = 0) -> float:
        return float(modes(loop(changed_servo, age_steps), dt)[0].real)

    latencies = range(LARGEST_LATENCY_STEPS + 1) if observer else ()
    return Prediction(
        first_crossing(lambda lag: growth(servo.damp(lag)), 5e-3, LARGEST_S),
        first_crossing(lambda lag: growth(servo.soften(lag)), 5e-3, LARGEST_S),
        next((steps / 1000 for steps in latencies if growth(servo, steps) > 0.0), None),
        oscillation(loop(servo), dt),
    )


def largest_tau() -> float | None:
    """Find the time constant of (8) from which the loop oscillates with the model's servo [s]; its lag is 2 tau."""

    def growth(tau: float) -> float:
        loop, servo, dt = linearise("linear", tau=tau)
        return float(modes(loop(servo), dt)[0].real)

    return first_crossing(growth, 0.01, 0.1)


class Lags(NamedTuple):
    """All of it."""

    sweeps: dict[str, Sweep]
    thresholds: dict[str, Threshold]
    latencies: dict[str, Threshold]
    predictions: dict[str, Prediction]
    """Predictions for the linear observers and, under `truth`, for the true rate."""
    tau: float | None
    own_lag_s: float
    """Lag of the model's servo."""


def lags(on_share: OnShare) -> Lags:
    """Sweep, sharpen and predict all lags."""
    lag_sweeps = sweeps(list(OBSERVERS))
    thresholds = lag_thresholds(lag_sweeps)
    latencies: dict[str, Threshold] = {}
    for i, name in enumerate(OBSERVERS):
        latencies[name] = latency_threshold(name)
        on_share((i + 1) / 4.0)
    predictions = {name: predict(name) for name in ("linear", "luenberger")} | {"truth": predict(None)}
    return Lags(lag_sweeps, thresholds, latencies, predictions, largest_tau(), float(lag_sweeps["linear"].lags_s[0]))


def in_ms(seconds: float | None, otherwise: str = "none") -> str:
    """Write a time in words."""
    return otherwise if seconds is None else f"{1e3 * seconds:.1f} ms"


def claim(results: Lags) -> Claim:
    """Judge section V: the differentiator's lag."""
    own_lag, lags, latencies = results.own_lag_s, results.thresholds, results.latencies
    begin, least = lags["linear"], min(lags[name].low for name in ("luenberger", "homogeneous"))
    return Claim(
        place="Section V, the lag",
        statement="Finite differences lag, and the lag brings the loop into sustained oscillations.",
        assumes={"servo": f"a lag of up to {1e3 * LARGEST_S:.0f} ms"},
        holds=begin.high is not None and begin.high < least,
        conditions=(
            f"It does with a servo lag from {in_ms(begin.middle)} or a latency of y1 from "
            f"{in_ms(latencies['linear'].high)}; at the model's servo lag of {in_ms(own_lag)} the oscillation decays."
            if begin.middle is not None and begin.middle > own_lag
            else ""
        ),
        otherwise="The loop of (8) is not the first to oscillate.",
        figures={
            "servo_lag_of_the_model_s": own_lag,
            "servo_lag_threshold_s": {name: list(begin) for name, begin in lags.items()},
            "latency_threshold_s": {name: list(begin) for name, begin in latencies.items()},
            "predicted": {
                name: {
                    "servo_lag_s": p.servo_lag_s,
                    "softened_servo_lag_s": p.softened_lag_s,
                    "latency_s": p.latency_s,
                    "pole_1_s": [p.pole.real, p.pole.imag],
                    "damping_ratio": p.damping,
                }
                for name, p in results.predictions.items()
            },
            "tau_threshold_s": results.tau,
        },
        pictures=[_picture(results)],
    )


def _growth(observer: str, lags_s: np.ndarray) -> list[float]:
    """Return the growth of the tilt's oscillation over the servo lag [1/s]."""
    loop, servo, dt = linearise(observer)
    return [oscillation(loop(servo.damp(float(lag))), dt).real for lag in lags_s]


def _picture(results: Lags) -> Picture:
    grid = np.linspace(5e-3, 0.07, 66)
    rates = [
        Line(1e3 * grid, _growth(name, grid), f"{OBSERVERS[name]} {name}", color=name)
        for name in ("linear", "luenberger")
    ]
    rates.append(Line([5.0, 70.0], [0.0, 0.0], style="k:", width=0.8))
    tilts = [
        Line(1e3 * s.lags_s, s.amplitude_deg, f"{OBSERVERS[name]} {name}", "os^"[i] + "-", color=name)
        for i, (name, s) in enumerate(results.sweeps.items())
    ]
    panels = [
        Panel("growth of the tilt's\noscillation [1/s]", rates, "linearised and sampled", x_label="servo lag [ms]"),
        Panel(
            "largest tilt after\n4 s [deg]",
            tilts,
            "MuJoCo, released at 0.2 deg, no noise",
            x_label="servo lag [ms]",
            y_scale="log",
        ),
    ]
    title = "sokolov2019, Section V: which servo lag brings sustained oscillation"
    return Picture("sokolov2019-lag", title, panels)


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
