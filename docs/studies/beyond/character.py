"""An observer's answer to a signal: its lag, its noise gain, and the cost of an update."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.features.replay import replay
from cmg_mj.observers import Measurement, Observer, make_observer
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.benchmark import time_of_update
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

PUSH_N_M, PUSH_S = 1.0, 0.1
"""The push whose lag is found."""


class Motion(NamedTuple):
    """A motion of the rig, measured with and without noise, the law fed by the gyro."""

    experiment: Experiment
    noisy: Trajectory
    clean: Trajectory


def record_motion(noise_ug: float, worlds: int, seed: int) -> Motion:
    """Record the tuning experiment without equilibrium bias.

    Args:
        noise_ug: Noise density of the accelerometers [ug/rtHz].
        worlds: Number of worlds.
        seed: Seed of their noise.

    Returns:
        The motion; the noiseless measurement is the true tilt, and the true rate's slope.
    """
    settings = [
        "plant.equilibrium_bias_deg=0.0",
        f"sensors.accelerometer.noise_density_ug_rthz={noise_ug}",
        f"seed={seed}",
        "duration_s=5.0",
        "open_loop_observers=[]",
    ]
    experiment = prepare(load_scenario("observer_tuning", settings))
    noisy = experiment.run_many(worlds).trajectory
    assert noisy is not None
    slope = np.gradient(noisy["x2_rad_s"], experiment.law.dt, axis=0)
    truth = {"y1_rad": noisy["x1_rad"], "acceleration_rad_s2": slope}
    return Motion(experiment, noisy, Trajectory({**noisy.columns, **truth}))


class Character(NamedTuple):
    """An observer's answer to motion and to noise."""

    lag_s: float | None
    """`push_lag` [s]."""
    noise_gain_per_s: float
    """RMS of what noise adds to the velocity estimate, over RMS of the noise of y1 [1/s]. What an observer is shown of
    the acceleration is as noisy as its sensors make it."""


def character(kind: str, motion: Motion) -> Character:
    """Replay an observer on the same motion with and without noise for its lag and noise gain."""
    experiment = motion.experiment
    observer = make_observer(kind, *experiment.design.constructor_arguments)
    clean = replay(observer, motion.clean).x2
    noise_response = replay(observer, motion.noisy).x2 - clean
    late = motion.noisy["time_s"] > 1.0
    noise = motion.noisy["y1_rad"] - motion.clean["y1_rad"]
    gain = np.sqrt(np.mean(noise_response[late] ** 2) / np.mean(noise[late] ** 2))
    return Character(push_lag(observer, experiment.plant.reduced, experiment.law.dt), float(gain))


def push_lag(observer: Observer, model: ReducedModel, dt: float) -> float | None:
    """Measure how late an observer sees a sudden push, without noise and with the gimbals still.

    From rest at the upright the rig is pushed with 1 N m for 0.1 s and left to itself: in linear terms its rate is
    a sinh. The lag is the time between the true rate and the estimate passing half of the rate at the push's end. In
    the loop the law's answer hides this: an observer with a model knows at once what the gimbals do about the push,
    and of the push nothing, so that its estimate first moves the wrong way.

    Args:
        observer: The observer.
        model: The rig's reduced model.
        dt: The sample period [s].

    Returns:
        The lag [s]; None if the estimate has not come there after half a second.
    """
    pole = math.sqrt(model.gravity_torque / model.J1)
    acceleration = PUSH_N_M / (model.gimbals * model.J1)
    t = np.arange(-0.2, 0.5, dt)

    def torque_response(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tilt and rate under a torque that began at t = 0."""
        t = np.maximum(t, 0.0)
        return acceleration / pole**2 * (np.cosh(pole * t) - 1.0), acceleration / pole * np.sinh(pole * t)

    tilt, rate = (now - later for now, later in zip(torque_response(t), torque_response(t - PUSH_S), strict=True))
    push = 0.5 * (np.sign(np.round(t / dt, 6)) - np.sign(np.round((t - PUSH_S) / dt, 6)))  # at its edges half of it
    measurements = np.stack([tilt, pole**2 * tilt + acceleration * push], axis=1).tolist()
    state = observer.init(Measurement(measurements[0][0], 0.0, measurements[0][1]))
    estimate = [0.0]
    for y1, slope in measurements[1:]:
        state, output = observer.step(state, Measurement(y1, 0.0, slope), 0.0)
        estimate.append(output[1])
    half = 0.5 * acceleration / pole * math.sinh(pole * PUSH_S)
    true_time, estimate_time = _first_passing(t, rate, half), _first_passing(t, np.array(estimate), half)
    return None if true_time is None or estimate_time is None else estimate_time - true_time


def _first_passing(time_s: np.ndarray, values: np.ndarray, level: float) -> float | None:
    """Return the time at which a signal first passes a level on its way from zero [s]; None if it never does."""
    passing = np.flatnonzero(values / level >= 1.0)
    if not len(passing):
        return None
    k = int(passing[0])
    if k == 0:
        return float(time_s[0])
    share = (level - values[k - 1]) / (values[k] - values[k - 1])
    return float(time_s[k - 1] + share * (time_s[k] - time_s[k - 1]))


def update_us(kind: str, motion: Motion) -> float:
    """Measure the microseconds of one update on floats, along half a second of the motion."""
    experiment = motion.experiment
    observer = make_observer(kind, *experiment.design.constructor_arguments)
    excerpt = motion.noisy.between(2.0, 2.5)
    names = "y1_rad", "y2_rad", "acceleration_rad_s2", "u_rad_s"
    return time_of_update(observer, *(excerpt[name][:, 0].tolist() for name in names))
