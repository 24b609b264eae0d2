"""Section V: which lag makes the loop oscillate by itself: on MuJoCo, and by the eigenvalues of the sampled loop.

From one control tick to the next the rig is linear near its equilibrium, and so are the linear observers and the law:
the map of a period is a matrix, and the loop oscillates by itself when an eigenvalue leaves the unit circle. The
matrix is made by running the observer and the law themselves on unit vectors, so it is the loop as implemented.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from cmg_mj.core.reduced_model import ReducedModel, hold_matrices
from cmg_mj.laws.state_feedback import StateFeedback
from cmg_mj.observers import Measurement, Observer
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.rig import FINE, NO_NOISE, Servo, estimator, experiment, make_rig, read_servo
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment
from cmg_mj.runs.side_by_side import BatchJob, run_jobs
from cmg_mj.view.plots.figure import Line, Panel, Picture


def rig_matrices(model: ReducedModel, servo: Servo) -> tuple[Array, Array]:
    """Linearise sokolov2019 (1) with the servo's torque upright: x' = A x + B u.

    The state is tilt, tilt rate, gimbal angle, gimbal rate and setpoint. The flywheel's torque -J_d w_d x2 drives the
    gimbal back.

    Returns:
        A (5, 5), B (5, 1).
    """
    h, J1, inertia = model.J_d * model.omega_d, model.J1, servo.inertia
    A = np.zeros((5, 5))
    A[0, 1] = 1.0
    A[1, [0, 3]] = model.gravity_torque / J1, h / J1
    A[2, 3] = 1.0
    A[3, [1, 2, 3, 4]] = -h / inertia, -servo.kp / inertia, -servo.kv / inertia, servo.kp / inertia
    B = np.zeros((5, 1))
    B[4, 0] = 1.0
    return A, B


def period_map(
    experiment: Experiment, observer: Observer | None, servo: Servo, age_steps: int = 0, share: complex = 1.0
) -> Array:
    """Return the matrix that takes the loop from one control tick to the next.

    Args:
        experiment: Its rig, but for the servo, and its law; the law's rate limit does not count.
        observer: A linear observer; None for the true rate in the law.
        servo: The gimbal's servo.
        age_steps: Age of y1 at a tick [physics steps]: the latency of the accelerometers.
        share: Share of the commanded rate that reaches the gimbal's setpoint: 1, or the describing function of a gap.

    Returns:
        A square matrix. Its state is that of the rig, the tilts not yet seen, the observer's, x_e and the last u.
    """
    assert isinstance(experiment.law, StateFeedback)
    law, timestep = replace(experiment.law, rate_limit=math.inf), experiment.plant.model.opt.timestep
    Phi, hold, _ = hold_matrices(*rig_matrices(experiment.plant.reduced, servo), timestep)
    start: Any = observer.init(Measurement(0.0, 0.0)) if observer else ()
    parts = np.cumsum([5, age_steps, len(start)])

    def period(v: Array) -> Array:
        rig, pending_tilts, observer_state, (x_e, u) = np.split(v, parts)
        y1, y2 = (pending_tilts[-1] if age_steps else rig[0]), rig[2]
        x2 = rig[1]
        if observer:
            state, estimate = observer.step(type(start)(*observer_state), Measurement(y1, y2), u)
            observer_state, x2 = np.array(state), estimate.x2
        u, x_e = law(y1, x2, y2, x_e)
        for _ in range(round(law.dt / timestep)):
            pending_tilts = np.concatenate([rig[:1], pending_tilts])[:age_steps]
            rig = Phi @ rig + hold[:, 0] * (share * u)
        return np.concatenate([rig, pending_tilts, observer_state, [x_e, u]])

    return np.column_stack([period(unit) for unit in np.eye(parts[-1] + 2)])


def modes(matrix: Array, dt: float) -> Array:
    """Return the poles s = log(z)/dt of a period's map, the least damped first [1/s]."""
    z = np.linalg.eigvals(matrix)
    s = np.log(z[np.abs(z) > 1e-9].astype(complex)) / dt
    return s[np.argsort(-s.real)]


def oscillation(matrix: Array, dt: float) -> complex:
    """Find the least damped oscillating pole with a frequency above 1 rad/s [1/s]: the integrator's pair is slower."""
    return complex(next(s for s in modes(matrix, dt) if s.imag > 1.0))


def first_crossing(
    value: Callable[[float], float], low: float, high: float, points: int = 40, xtol: float = 1e-7
) -> float | None:
    """Return the smallest argument at which a function rises through zero, on a grid; None if it does not."""
    grid = np.linspace(low, high, points).tolist()
    values = [value(x) for x in grid]
    for (a, at_a), (b, at_b) in pairwise(zip(grid, values, strict=True)):
        if at_a < 0.0 <= at_b:
            root: Any = brentq(value, a, b, xtol=xtol)
            return root
    return None


# --- releases on MuJoCo -----------------------------------------------------------------------------------------

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
PARTS = 10
"""A threshold is found to this part of the spacing of the lags."""
MAX_LATENCY_STEPS = 64
"""The largest latency tried [physics steps]."""


def is_sustained(trajectory: Trajectory, window_s: float = WINDOW_S) -> Array:
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
    results = run_jobs(runs)
    return {observer: trajectory_of(result) for observer, result in zip(servos, results, strict=True)}


class Sweep(NamedTuple):
    """Releases over the servo's lag."""

    lags_s: Array
    """(n_lags,)."""
    sustained: Array
    """True where the loop oscillates by itself, (n_lags,)."""
    amplitude_deg: Array
    """Largest tilt over the last two seconds, (n_lags,); NaN where the rig fell."""


def sweep_lags() -> dict[str, Sweep]:
    """Release the rig with the model's servo and with slower ones, as stiff, with each observer."""
    servo = read_servo(experiment().plant)
    lags = np.array([servo.lag_s, *LAGS_S])
    servos = [servo.damp(lag) for lag in lags]
    sweeps = {}
    for observer, run in releases(dict.fromkeys(OBSERVERS, servos)).items():
        t = run["time_s"]
        amplitude = np.degrees(np.abs(run["x1_rad"][t > t[-1] - WINDOW_S]).max(axis=0))
        sweeps[observer] = Sweep(lags, is_sustained(run), amplitude)
    return sweeps


Threshold = tuple[float, float | None]
"""Begin of something: not yet at the first, already at the second, which is None if nowhere in the range."""


def lag_thresholds(sweeps: Mapping[str, Sweep]) -> dict[str, Threshold]:
    """Find the least servo lag at which each loop oscillates by itself, to a tenth of the sweep's spacing [s]."""
    thresholds: dict[str, Threshold] = {}
    servo = read_servo(experiment().plant)
    for observer, (lags, sustained, _) in sweeps.items():
        thresholds[observer] = lags[-1], None
        if sustained.any():
            first = np.argmax(sustained)
            grid = np.linspace(lags[first - 1], lags[first], PARTS + 1)
            refined = releases({observer: [servo.damp(lag) for lag in grid[1:]]})[observer]
            i = np.argmax(is_sustained(refined))  # the last of them is the sweep's own
            thresholds[observer] = grid[i], grid[i + 1]
    return thresholds


def latency_threshold(observer: str) -> Threshold:
    """Find the least latency of the accelerometers at which the loop oscillates, to one physics step [s].

    They are sampled at every physics step here, so that the latency is not rounded up to control periods.
    """

    def oscillates(steps: int) -> bool:
        latency = f"sensors.accelerometer.latency_s={steps / 1000}"
        result = experiment([*RELEASE, FINE, "sensors.accelerometer.rate_hz=1000.0", latency], observer).run()
        return not result.stood.all() or is_sustained(trajectory_of(result))[0]

    steps = bisect_left(range(1, MAX_LATENCY_STEPS + 1), True, key=oscillates)
    return steps / 1000, (steps + 1) / 1000 if steps < MAX_LATENCY_STEPS else None


# --- the sampled loop -------------------------------------------------------------------------------------------

MAX_LAG_S = 0.12
"""Lags are searched up to here in the linearised loop [s]."""

Loop = Callable[..., Array]
"""(servo, age_steps=0, share=1.0) -> the map of a control period."""


@cache
def _rig() -> Experiment:
    """Prepare the rig with the physics step of the releases, in which latencies are counted."""
    return experiment([FINE])


def linearise(observer: str | None, **parameters: float) -> tuple[Loop, Servo, float]:
    """Linearise the sampled loop with an observer, or with the true rate (None); parameters differ from Table II's."""
    prepared = _rig()
    o = None if observer is None else estimator(observer, prepared, **parameters)
    return partial(period_map, prepared, o), read_servo(prepared.plant), prepared.law.dt


def predict(observer: str | None) -> dict[str, float | list[float] | None]:
    """Predict the linearised loop's behaviour with a linear observer, or with the true rate (None).

    Returns:
        The least servo lag at which it oscillates, as stiff, and of a critically damped servo that is less stiff; the
        least latency of y1, in whole physics steps; None if it is not in the range searched. Pole and damping ratio of
        its least damped oscillation with the model's servo.
    """
    loop, servo, dt = linearise(observer)

    def growth(changed_servo: Servo, age_steps: int = 0) -> float:
        return modes(loop(changed_servo, age_steps), dt)[0].real

    latencies = range(MAX_LATENCY_STEPS + 1) if observer else ()
    pole = oscillation(loop(servo), dt)
    return {
        "servo_lag_s": first_crossing(lambda lag: growth(servo.damp(lag)), 5e-3, MAX_LAG_S),
        "softened_servo_lag_s": first_crossing(lambda lag: growth(servo.soften(lag)), 5e-3, MAX_LAG_S),
        "latency_s": next((steps / 1000 for steps in latencies if growth(servo, steps) > 0.0), None),
        "pole_1_s": [pole.real, pole.imag],
        "damping_ratio": -pole.real / abs(pole),
    }


def largest_tau() -> float | None:
    """Find the time constant of (8) from which the loop oscillates with the model's servo [s]; its lag is 2 tau."""

    def growth(tau: float) -> float:
        loop, servo, dt = linearise("linear", tau=tau)
        return modes(loop(servo), dt)[0].real

    return first_crossing(growth, 0.01, 0.1)


# --- the claim --------------------------------------------------------------------------------------------------


class Lags(NamedTuple):
    """All of it, by observer."""

    sweeps: Mapping[str, Sweep]
    thresholds: Mapping[str, Threshold]
    latencies: Mapping[str, Threshold]
    predictions: Mapping[str, Mapping]
    """Predictions for the linear observers and, under `truth`, for the true rate."""


def lags() -> Lags:
    """Sweep, sharpen and predict all lags."""
    sweeps = sweep_lags()
    thresholds = lag_thresholds(sweeps)
    latencies = {name: latency_threshold(name) for name in OBSERVERS}
    predictions = {name: predict(name) for name in ("linear", "luenberger")} | {"truth": predict(None)}
    return Lags(sweeps, thresholds, latencies, predictions)


def claim(results: Lags) -> Claim:
    """Judge section V: the differentiator's lag."""
    begin, others = results.thresholds["linear"][1], [results.thresholds[n][0] for n in ("luenberger", "homogeneous")]
    grid, x_label = np.linspace(5e-3, 0.07, 66), "servo lag [ms]"
    rates = [Line([5.0, 70.0], [0.0, 0.0], style="k:", width=0.8)]
    for name in ("linear", "luenberger"):
        loop, servo, dt = linearise(name)
        growth = [oscillation(loop(servo.damp(lag)), dt).real for lag in grid]
        rates.insert(-1, Line(1e3 * grid, growth, f"{OBSERVERS[name]} {name}", color=name))
    tilts = [
        Line(1e3 * s.lags_s, s.amplitude_deg, f"{OBSERVERS[name]} {name}", "os^"[i] + "-", color=name)
        for i, (name, s) in enumerate(results.sweeps.items())
    ]
    panels = [
        Panel("growth of the tilt's\noscillation [1/s]", rates, "linearised and sampled", x_label),
        Panel("largest tilt after\n4 s [deg]", tilts, "MuJoCo, released at 0.2 deg, no noise", x_label, y_scale="log"),
    ]
    return Claim(
        "Section V, the lag",
        "Finite differences lag, and the lag brings the loop into sustained oscillations.",
        assumes={"servo": f"a lag of up to {1e3 * MAX_LAG_S:.0f} ms"},
        holds=begin is not None and begin < min(others),
        conditions="It does with a slower servo or a later y1; at the model's servo lag the oscillation decays.",
        figures={
            "servo_lag_of_the_model_s": results.sweeps["linear"].lags_s[0],
            "servo_lag_threshold_s": results.thresholds,
            "latency_threshold_s": results.latencies,
            "predicted": results.predictions,
            "tau_threshold_s": largest_tau(),
        },
        picture=Picture(
            "sokolov2019-lag", "sokolov2019, Section V: which servo lag brings sustained oscillation", panels
        ),
    )
