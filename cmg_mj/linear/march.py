"""Marches a scenario's controller with its plant linearised: whether a loop without a linear system is stable."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from cmg_mj.linear.loop import ClosedLoop
from cmg_mj.linear.plant import LinearPlant
from cmg_mj.scenario.design import Design

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

    Sensors, observer, law, notch and rate limit are those of a run, without noise and rounding; what the sensors show
    at rest counts as zero. The plant is marched exactly between samples, but for its torque, which goes with the cosine
    of the gimbals' angle.

    It starts from small tilt rates, and once as the scenario does, with its strongest push.

    Args:
        design: The law and the observers.
        plant: The plant, in the states of `linearise`.

    Returns:
        The motion.
    """
    scenario = design.scenario
    worlds = len(STARTS_RAD_S) + 1  # one for each small start, and the scenario's own as the last
    loop = ClosedLoop(design, plant, worlds=worlds)
    interval = loop.interval * design.rig.timestep
    tilt, rate = (row / (row @ row) for row in plant.C[:2])
    x = np.transpose([*np.outer(STARTS_RAD_S, rate), math.radians(scenario.plant.initial_tilt_deg) * tilt])
    bias, torque, u, y2 = np.zeros((4, worlds))
    bias[-1] = math.radians(scenario.plant.equilibrium_bias_deg)
    pushes = [(push.torque_n_m, push.duration_s) for push in scenario.push]
    torque[-1], push_s = max(pushes, key=lambda push: abs(push[0] * push[1]), default=(0.0, interval))
    sampled, deciding = (), None
    fell = np.zeros(worlds, bool)
    fall_angle = math.radians(scenario.metrics.fall_angle_deg)
    ticks = math.ceil(max(WINDOW_S, 4.0 * design.law.dt) / interval)
    instant, sizes = 0, []
    with np.errstate(all="ignore"):
        for duration in (DURATION_S, LONG_DURATION_S):
            while not fell.all() and instant * interval < duration:
                squares = np.zeros((2, worlds))
                for _ in range(ticks):
                    push = (PUSH_S <= instant * interval < PUSH_S + push_s) * torque
                    motion = loop.motion(x, 0.0 * u, push)
                    fell |= ~(np.abs(motion[3]) < fall_angle)  # true where it is not a number
                    squares += np.square([motion[1], y2])
                    motion[2] = y2
                    motion[3] -= bias
                    sampled = sampled or loop.start(*motion)
                    sampled, shown = loop.sense(instant * loop.interval, sampled, *motion)
                    if shown:
                        deciding, (u, *_) = loop.decide(instant * loop.interval, deciding, *shown)
                    x = np.where(fell, 0.0, loop.moved(x, u * np.cos(y2), push))
                    y2 = np.where(fell, 0.0, y2 + interval * u)
                    instant += 1
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
