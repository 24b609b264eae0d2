"""Which lag makes the single gimbal's loop oscillate by itself: on MuJoCo, and by the sampled loop's eigenvalues."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cmg_mj.observers import make_observer
from cmg_mj.papers.claim import Claim, OnShare, verdict
from cmg_mj.papers.sokolov2019.sampled_loop import Servo, first_crossing, modes, oscillation, period_map
from cmg_mj.papers.sokolov2019.single_gimbal import (
    WINDOW_S,
    Threshold,
    experiment,
    is_sustained,
    latency_threshold,
    release,
    servo_lag_threshold,
    servo_of,
)
from cmg_mj.picture import Line, Panel, Picture

PAPERS = {"linear": "(8)", "luenberger": "(9)", "homogeneous": "(10)"}
LAGS_S = (0.012, 0.015, 0.017, 0.019, 0.020, 0.022, 0.025, 0.030, 0.035, 0.040, 0.045)
"""Servo lags tried, after the model's own [s]. RK4 at 1 ms forbids more than 49 ms at the model's stiffness."""
LARGEST_LATENCY_STEPS = 64
LARGEST_S = 0.12
"""Lags are searched up to here in the linearised loop [s]."""


class Sweep(NamedTuple):
    """Releases without noise over the servo's lag."""

    lags_s: np.ndarray
    """(n_lags,)."""
    sustained: np.ndarray
    """Whether the loop oscillates by itself, (n_lags,)."""
    amplitude_deg: np.ndarray
    """Largest tilt over the last two seconds, (n_lags,); NaN where the rig fell."""


def sweep(observer: str) -> Sweep:
    """Release the rig with the model's servo and with slower ones, as stiff."""
    servo = servo_of(experiment().plant)
    lags = np.array([servo.lag_s, *LAGS_S])
    trajectory = release(observer, [servo.damped(lag) for lag in lags]).trajectory
    assert trajectory is not None
    late = trajectory["time_s"] > trajectory["time_s"][-1] - WINDOW_S
    return Sweep(lags, is_sustained(trajectory), np.degrees(np.abs(trajectory["x1_rad"][late]).max(axis=0)))


def sharpened(observer: str, found: Sweep, parts: int = 10) -> Threshold:
    """The threshold in a sweep, to a tenth of the sweep's spacing."""
    first = np.flatnonzero(found.sustained)
    if not len(first):
        return Threshold(float(found.lags_s[-1]), None)
    if first[0] == 0:
        return Threshold(0.0, float(found.lags_s[0]))
    low, high = (float(found.lags_s[i]) for i in (first[0] - 1, first[0]))
    return servo_lag_threshold(observer, low=low, high=high, cuts=1, parts=parts)


class Predicted(NamedTuple):
    """Of one observer in the linearised, sampled loop; None for what does not happen in the range searched."""

    servo_lag_s: float | None
    """The least servo lag at which it oscillates, as stiff."""
    softened_lag_s: float | None
    """The same for a critically damped servo that is less stiff."""
    latency_s: float | None
    """The least latency of y1, in whole physics steps."""
    pole: complex
    """Its least damped oscillation with the model's servo [1/s]."""

    @property
    def damping(self) -> float:
        """Damping ratio of that oscillation."""
        return -self.pole.real / abs(self.pole)


def predicted(observer: str | None) -> Predicted:
    """What the linearised loop does with a linear observer, or with the true rate (None)."""
    prepared = experiment()
    plant, law = prepared.plant, prepared.law
    timestep, servo = plant.model.opt.timestep, servo_of(plant)
    o = None if observer is None else make_observer(observer, law.dt, plant.reduced)

    def largest(varied: Servo, age_steps: int = 1) -> float:
        matrix = period_map(plant.reduced, varied, o, law, timestep=timestep, age_steps=age_steps)
        return float(modes(matrix, law.dt)[0].real)

    latencies = range(LARGEST_LATENCY_STEPS + 1)
    unstable = next((steps * timestep for steps in latencies if largest(servo, 1 + steps) > 0.0), None)
    return Predicted(
        first_crossing(lambda lag: largest(servo.damped(lag)), 5e-3, LARGEST_S),
        first_crossing(lambda lag: largest(servo.softened(lag)), 5e-3, LARGEST_S),
        unstable if observer is not None else None,
        oscillation(period_map(plant.reduced, servo, o, law, timestep=timestep), law.dt),
    )


def largest_tau() -> float | None:
    """The time constant of (8) from which the loop oscillates with the model's servo [s]; its own lag is 2 tau."""
    prepared = experiment()
    plant, law = prepared.plant, prepared.law
    servo = servo_of(plant)

    def largest(tau: float) -> float:
        o = make_observer("linear", law.dt, plant.reduced, tau=tau)
        matrix = period_map(plant.reduced, servo, o, law, timestep=plant.model.opt.timestep)
        return float(modes(matrix, law.dt)[0].real)

    return first_crossing(largest, 0.01, 0.1)


class Lags(NamedTuple):
    """All of it."""

    sweeps: dict[str, Sweep]
    thresholds: dict[str, Threshold]
    latencies: dict[str, Threshold]
    predictions: dict[str, Predicted]
    """Of the linear observers and, under `truth`, of the true rate."""
    tau: float | None
    own_lag_s: float
    """Of the model's servo."""


def lags(on_share: OnShare) -> Lags:
    """Sweep, sharpen, and predict."""
    sweeps: dict[str, Sweep] = {}
    thresholds: dict[str, Threshold] = {}
    latencies: dict[str, Threshold] = {}
    for i, name in enumerate(PAPERS):
        sweeps[name] = sweep(name)
        thresholds[name] = sharpened(name, sweeps[name])
        latencies[name] = latency_threshold(name, LARGEST_LATENCY_STEPS)
        on_share((i + 1) / 4.0)
    predictions = {name: predicted(name) for name in ("linear", "luenberger")} | {"truth": predicted(None)}
    return Lags(sweeps, thresholds, latencies, predictions, largest_tau(), float(sweeps["linear"].lags_s[0]))


def _ms(seconds: float | None, otherwise: str) -> str:
    return otherwise if seconds is None else f"{1e3 * seconds:.1f} ms"


def claim(found: Lags) -> Claim:
    """Section V: the differentiator's lag."""
    own, lag, latency = found.own_lag_s, found.thresholds, found.latencies
    linear = found.predictions["linear"]
    begins = lag["linear"].middle
    others = [lag[name].low for name in ("luenberger", "homogeneous")]
    first = begins is not None and lag["linear"].high is not None and lag["linear"].high < min(others)
    conditions = (
        f"with a servo lag from {1e3 * begins:.1f} ms or a latency of y1 from {_ms(latency['linear'].high, 'none')}; "
        f"at the model's servo lag of {1e3 * own:.1f} ms the oscillation decays"
        if begins is not None and begins > own
        else ""
    )
    none = f"none up to {1e3 * LAGS_S[-1]:.0f} ms"
    longest = f"none up to {LARGEST_LATENCY_STEPS} ms"
    listed = "; ".join(
        f"{equation} servo lag {_ms(lag[name].middle, none)}, latency {_ms(latency[name].high, longest)}"
        for name, equation in PAPERS.items()
    )
    luenberger, truth = found.predictions["luenberger"], found.predictions["truth"]
    return Claim(
        place="Section V, the lag",
        says="Finite differences lag, and the lag brings the loop into sustained oscillations.",
        found=(
            f"Released without noise, the rig oscillates by itself from these on: {listed}. Eigenvalues of the "
            f"linearised, sampled loop say: (8) {_ms(linear.servo_lag_s, 'none')} and {_ms(linear.latency_s, 'none')}, "
            f"(9) {_ms(luenberger.servo_lag_s, 'none')} and {_ms(luenberger.latency_s, 'none')}, the true rate in the "
            f"law {_ms(truth.servo_lag_s, 'none')}. With the model's servo ({1e3 * own:.1f} ms) the loop of (8) has "
            f"poles {linear.pole.real:.1f} +- {linear.pole.imag:.1f}j 1/s, a damping ratio of {linear.damping:.2f} at "
            f"{linear.pole.imag / (2.0 * np.pi):.1f} Hz; from tau = {_ms(found.tau, 'none')} on it would oscillate as "
            "it is. A servo that lags because it is soft never does it "
            f"({_ms(linear.softened_lag_s, f'none up to {1e3 * LARGEST_S:.0f} ms')}): the flywheel then turns the "
            "gimbal back, which damps the tilt."
        ),
        verdict=verdict(first, conditions),
        why=conditions if first else "The loop of (8) is not the first to oscillate.",
        figures={
            "servo_lag_of_the_model_s": own,
            "servo_lag_threshold_s": {name: [t.low, t.high] for name, t in lag.items()},
            "latency_threshold_s": {name: [t.low, t.high] for name, t in latency.items()},
            "predicted": {
                name: {
                    "servo_lag_s": p.servo_lag_s,
                    "softened_servo_lag_s": p.softened_lag_s,
                    "latency_s": p.latency_s,
                    "pole_1_s": [p.pole.real, p.pole.imag],
                    "damping_ratio": p.damping,
                }
                for name, p in found.predictions.items()
            },
            "tau_threshold_s": found.tau,
        },
        pictures=[_picture(found)],
    )


def _growth_of(observer: str) -> Callable[[float], float]:
    prepared = experiment()
    plant, law = prepared.plant, prepared.law
    o = make_observer(observer, law.dt, plant.reduced)
    servo = servo_of(plant)

    def of(lag: float) -> float:
        matrix = period_map(plant.reduced, servo.damped(lag), o, law, timestep=plant.model.opt.timestep)
        return oscillation(matrix, law.dt).real

    return of


def _picture(found: Lags) -> Picture:
    grid = np.linspace(5e-3, 0.07, 66)
    rates = []
    for i, name in enumerate(("linear", "luenberger")):
        of = _growth_of(name)
        rates.append(Line(1e3 * grid, [of(float(lag)) for lag in grid], f"{PAPERS[name]} {name}", color=i + 1))
    rates.append(Line([5.0, 70.0], [0.0, 0.0], style="k:", width=0.8))
    tilts = [
        Line(1e3 * s.lags_s, s.amplitude_deg, f"{PAPERS[name]} {name}", "os^"[i] + "-", color=i + 1)
        for i, (name, s) in enumerate(found.sweeps.items())
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
