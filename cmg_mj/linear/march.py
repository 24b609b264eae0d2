"""Marches a scenario's controller with its plant linearised: whether a loop without a linear system is stable."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.controller import PlantInterface
from cmg_mj.core.tilt import GimbalAngle, RadialTilt
from cmg_mj.core.types import IdealReading
from cmg_mj.linear.plant import LinearPlant
from cmg_mj.scenario.design import Design
from cmg_mj.sensors.accelerometer import Accelerometer
from cmg_mj.sensors.sampled import Sensors

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
    motions = _March(design, plant)
    motions.advance(DURATION_S)
    if motions.is_undecided:
        motions.advance(LONG_DURATION_S)
    return motions.motion


class _March:
    """The closed loop: a world for each small start, and for the scenario's own as the last."""

    def __init__(self, design: Design, plant: LinearPlant) -> None:
        scenario, self._rig, self._plant = design.scenario, design.rig, plant
        worlds = len(STARTS_RAD_S) + 1
        known = PlantInterface(design.rig.tilt, GimbalAngle((1.0,), (0.0,)), design.rig.timestep)
        quiet = _quiet(design.scenario.sensors)
        self._controller = design.controller(known, worlds=range(worlds), sensors=quiet, open_loop_observers={})
        self._interval = self._controller.steps_per_sample * design.rig.timestep
        self._F, self._G = plant.hold(self._interval)
        tilt, rate = (row / (row @ row) for row in plant.C[:2])
        starts = [*np.outer(STARTS_RAD_S, rate), math.radians(scenario.plant.initial_tilt_deg) * tilt]
        self._x = np.transpose(starts)
        self._bias = np.zeros(worlds)
        self._bias[-1] = math.radians(scenario.plant.equilibrium_bias_deg)
        pushes = [(push.torque_n_m, push.duration_s) for push in scenario.push]
        torque, push_s = max(pushes, key=lambda push: abs(push[0] * push[1]), default=(0.0, self._interval))
        self._push_ends = PUSH_S + push_s
        self._push = np.zeros(worlds)
        self._push[-1] = torque
        self._u, self._y2, self._fell = np.zeros(worlds), np.zeros(worlds), np.zeros(worlds, bool)
        self._step = 0
        self._fall_angle = math.radians(scenario.metrics.fall_angle_deg)
        self._sizes: list[np.ndarray] = []

    def advance(self, until: float) -> None:
        """March until a time [s], or until all have fallen."""
        with np.errstate(all="ignore"):
            while not self._fell.all() and self._step * self._rig.timestep < until:
                self._sizes.append(self._window())

    @property
    def _decays(self) -> np.ndarray:
        """True for each motion that has decayed, (n_starts,); of the scenario's own the tilt's rate alone counts."""
        sizes = np.array(self._sizes)
        largest, latest = sizes.max(axis=0), sizes[-GROWING_WINDOWS:]
        grows = (sizes[-1] > TAIL * largest) & (np.diff(latest, axis=0) > 0.0).all(axis=0)
        small = ((sizes[-1] <= DECAY * largest) | (sizes[-1] <= REST)) & (~grows | (len(sizes) < GROWING_WINDOWS))
        small[1, -1] = True
        return np.all(small, axis=0) & ~self._fell

    @property
    def is_undecided(self) -> bool:
        """True if the small motions have neither all decayed nor grown."""
        first, last = self._sizes[0], self._sizes[-1]
        grown = np.any((last >= GROWTH * first) & (last > REST), axis=0) | self._fell
        return not self._decays[:-1].all() and not grown[:-1].any()

    @property
    def motion(self) -> Motion:
        """The motion from all starts."""
        if self._decays[:-1].all():
            return "decays" if self._decays[-1] else "decays if small"
        return "falls" if self._fell[:-1].any() else "swings"

    def _window(self) -> np.ndarray:
        """March over a window, and return the RMS of the tilt's rate and of the gimbals' angle, (2, n_starts)."""
        controller, plant = self._controller, self._plant
        ticks = math.ceil(max(WINDOW_S, 4.0 * controller.law.dt) / self._interval)
        squares = np.zeros((2, len(self._fell)))
        for _ in range(ticks):
            is_pushed = PUSH_S <= self._step * self._rig.timestep < self._push_ends
            push = is_pushed * self._push
            _, rate, _, y1, acceleration, gyro = plant.C @ self._x + np.outer(plant.D[:, 1], push)
            self._fell |= ~(np.abs(y1) < self._fall_angle)  # true where it is not a number
            squares += np.square([rate, self._y2])
            reading = _reading(self._rig.tilt, self._rig.gravity, y1 - self._bias, acceleration, self._y2, rate, gyro)
            if controller.update(self._step, reading):
                self._u = np.array(controller.gimbal_rate)
            x = self._F @ self._x + self._G @ np.array([self._u * np.cos(self._y2), push])
            self._x = np.where(self._fell, 0.0, x)
            self._y2 = np.where(self._fell, 0.0, self._y2 + self._interval * self._u)
            self._step += controller.steps_per_sample
        return np.sqrt(squares / ticks)


def _reading(
    tilt: RadialTilt, gravity: float, y1: Scalar, acceleration: Scalar, y2: Scalar, rate: Scalar, gyro: Scalar
) -> IdealReading:
    """Return the readings of perfect sensors in a motion about the pivot."""
    radial, across = gravity * np.cos(y1), -gravity * np.sin(y1)
    forces = [across + tilt.r_inner * acceleration, radial, across + tilt.r_outer * acceleration, radial]
    return IdealReading(np.array(forces), [y2], gyro, rate)


def _quiet(sensors: Sensors) -> Sensors:
    """Return the sensors with their rates, latencies, ranges and low-passes, and without errors."""
    pair = sensors.accelerometer
    pair = Accelerometer(
        rate_hz=pair.rate_hz,
        latency_s=pair.latency_s,
        range_g=pair.range_g,
        skew_s=pair.skew_s,
        bandwidth_hz=pair.bandwidth_hz,
        noise_density_ug_rthz=0.0,
        counts_per_g=0.0,
    )
    encoder = replace(sensors.encoder, counts_per_revolution=0.0)
    fog = replace(sensors.fog, angle_random_walk_deg_rth=0.0, bias_deg_h=0.0)
    return replace(sensors, accelerometer=pair, encoder=encoder, fog=fog)
