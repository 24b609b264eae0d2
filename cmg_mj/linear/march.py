"""Marches a scenario's controller with its plant linearised: whether a loop without a linear system is stable."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from cmg_mj.core.axis import KnownPlant
from cmg_mj.core.tilt import GimbalAngle
from cmg_mj.core.types import IdealReading
from cmg_mj.linear.plant import LinearPlant
from cmg_mj.scenario.design import Design
from cmg_mj.sensors import Sensors
from cmg_mj.sensors.accelerometer import Accelerometer

STARTS_RAD_S = (0.01, 0.05)
"""Tilt rates from which the motion has to decay: observers that are not linear answer to sizes."""
DURATION_S = 10.0
LONG_DURATION_S = 30.0
"""Duration of a motion that has neither decayed nor grown after `DURATION_S`."""
WINDOW_S = 2.0
"""The size of a motion is its RMS over such a time."""
PUSH_S = 2.0
"""The scenario's strongest push begins here."""
DECAY, GROWTH = 0.5, 2.0
"""A motion has decayed to at most this share of its largest size, or grown to at least so many times its first."""
REST = np.array([0.01, 0.005])[:, None]
"""Rate of the tilt [rad/s] and angle of the gimbals [rad] that count as rest unless they grow: noise causes more."""
GROWING_WINDOWS = 4
"""A size that rises over so many windows grows, however small it is, down to `TAIL` of its largest."""
TAIL = 0.003

Motion = Literal["decays", "decays if small", "swings", "falls"]
"""`decays if small`: it swings or falls with the scenario's own initial tilt, equilibrium bias and push.
`swings`: from a small start it neither decays nor falls."""
MOTION_WORDS: dict[Motion, str] = {
    "decays": "stable",
    "decays if small": "stable for small motions, but NOT for its own initial tilt, bias and push",
    "swings": "UNSTABLE",
    "falls": "UNSTABLE",
}


def march(design: Design, plant: LinearPlant) -> Motion:
    """March a scenario's controller in closed loop with a linear plant.

    Observer, law, notch and rate limit are those of a run; the sensors keep their rates, latencies and low-pass, and
    lose noise, resolution and mounting errors. The plant is marched exactly between samples, but for its torque, which
    goes with the cosine of the gimbals' angle.

    It starts from small tilt rates, and once as the scenario does, with its strongest push.

    Args:
        design: The law and the observers.
        plant: The plant, in the states of `linearise`.

    Returns:
        The motion.
    """
    scenario, rig = design.scenario, design.rig
    worlds = len(STARTS_RAD_S) + 1  # one for each small start, and the scenario's own as the last
    known = KnownPlant(rig.tilt, GimbalAngle((1.0,), (0.0,)), rig.timestep)
    controller = design.controller(
        known, world_ids=range(worlds), sensors=_quiet(scenario.sensors), open_loop_observers={}
    )
    interval = controller.steps_per_sample * rig.timestep
    F, G = plant.hold(interval)
    tilt, rate = (row / (row @ row) for row in plant.C[:2])
    x = np.transpose([*np.outer(STARTS_RAD_S, rate), math.radians(scenario.plant.initial_tilt_deg) * tilt])
    bias, torque = np.zeros((2, worlds))
    bias[-1] = math.radians(scenario.plant.equilibrium_bias_deg)
    pushes = [(push.torque_n_m, push.duration_s) for push in scenario.push]
    torque[-1], push_s = max(pushes, key=lambda push: abs(push[0] * push[1]), default=(0.0, interval))
    u, y2, fell = np.zeros(worlds), np.zeros(worlds), np.zeros(worlds, bool)
    fall_angle = math.radians(scenario.metrics.fall_angle_deg)
    ticks = math.ceil(max(WINDOW_S, 4.0 * controller.law.dt) / interval)
    step, sizes = 0, []
    with np.errstate(all="ignore"):
        for duration in (DURATION_S, LONG_DURATION_S):
            while not fell.all() and step * rig.timestep < duration:
                squares = np.zeros((2, worlds))
                for _ in range(ticks):
                    push = (PUSH_S <= step * rig.timestep < PUSH_S + push_s) * torque
                    _, x2, _, y1, acceleration, gyro = plant.C @ x + np.outer(plant.D[:, 1], push)
                    fell |= ~(np.abs(y1) < fall_angle)  # true where it is not a number
                    squares += np.square([x2, y2])
                    across, radial = -rig.gravity * np.sin(y1 - bias), rig.gravity * np.cos(y1 - bias)
                    forces = np.array(rig.tilt.forces(across, radial, acceleration))
                    if controller.update(step, IdealReading(forces, [y2], gyro, x2)):
                        u = np.array(controller.gimbal_rate)
                    x = np.where(fell, 0.0, F @ x + G @ np.array([u * np.cos(y2), push]))
                    y2 = np.where(fell, 0.0, y2 + interval * u)
                    step += controller.steps_per_sample
                sizes.append(np.sqrt(squares / ticks))
            motion, is_decided = _judge(np.array(sizes), fell)
            if is_decided:
                break
    return motion


def _judge(sizes: np.ndarray, fell: np.ndarray) -> tuple[Motion, bool]:
    """Judge the motions, and say whether the small ones have all decayed, or one has grown.

    Args:
        sizes: RMS of the tilt's rate and of the gimbals' angle in each window, (n_windows, 2, n_starts).
        fell: Whether each motion fell, (n_starts,).
    """
    first, last, largest, latest = sizes[0], sizes[-1], sizes.max(axis=0), sizes[-GROWING_WINDOWS:]
    grows = (last > TAIL * largest) & (np.diff(latest, axis=0) > 0.0).all(axis=0)
    small = ((last <= DECAY * largest) | (last <= REST)) & (~grows | (len(sizes) < GROWING_WINDOWS))
    small[1, -1] = True  # of the scenario's own motion the tilt's rate alone counts
    decays = np.all(small, axis=0) & ~fell
    grown = np.any((last >= GROWTH * first) & (last > REST), axis=0) | fell
    if decays[:-1].all():
        return ("decays" if decays[-1] else "decays if small"), True
    return ("falls" if fell[:-1].any() else "swings"), bool(grown[:-1].any())


def _quiet(sensors: Sensors) -> Sensors:
    """Return the sensors with their rates, latencies, ranges and low-passes, and without errors."""
    kept = ("rate_hz", "latency_s", "range_g", "skew_s", "bandwidth_hz")
    times = {name: getattr(sensors.accelerometer, name) for name in kept}
    pair = Accelerometer(**times, noise_density_ug_rthz=0.0, counts_per_g=0.0)
    encoder = replace(sensors.encoder, counts_per_revolution=0.0)
    fog = replace(sensors.fog, angle_random_walk_deg_rth=0.0, bias_deg_h=0.0)
    silent = ("noise_density_deg_s_rthz", "bias_instability_deg_h", "scale_error", "bias_deg_s", "counts_per_deg_s")
    gyro = replace(sensors.mems_gyro, reading="calibrated", **dict.fromkeys(silent, 0.0))
    return replace(sensors, accelerometer=pair, encoder=encoder, fog=fog, mems_gyro=gyro)
