"""Decides whether a loop around a frame that bends is stable: the controller at work on the linear plant."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from cmg_mj.controllers.controller import Controller, PlantInterface
from cmg_mj.controllers.make_controller import make_controller
from cmg_mj.elementwise import Scalar
from cmg_mj.scenario.linear_rig import BendModel
from cmg_mj.scenario.design import Design
from cmg_mj.sensors.gimbal_angle import GimbalAngle
from cmg_mj.sensors.ideal import IdealReading
from cmg_mj.sensors.sampled import Sensors
from cmg_mj.sensors.tilt import RadialTilt

STARTS_RAD_S = (0.003, 0.03, 0.3)
"""Tilt rates from which the motion has to decay: observers that are not linear answer to sizes."""
SMALL_STARTS = 2
"""The first so many starts are small: the gimbals' rate limit has no part in a motion that decays from there."""
DURATION_S = 10.0
LONG_DURATION_S = 60.0
"""Duration of a motion that has neither decayed nor fallen after `DURATION_S`."""
WINDOW_S = 2.0
"""The size of a motion is its RMS over such a time."""
DECAY = 0.5
"""A motion decays that at the end has this share of its largest size, or less."""
NEGLIGIBLE_RAD_S, NEGLIGIBLE_RAD = 0.002, 0.002
"""Rate of the tilt and angle of the gimbals that count as rest: the sensors' noise causes as much."""

Motion = Literal["decays", "decays if small", "swings", "falls"]
"""`decays if small`: from the largest start it swings or falls, because the gimbals' rate has a limit. `swings`: it
neither decays nor falls."""


class Decay(NamedTuple):
    """The motions of a loop from small starts.

    Attributes:
        bending: The motion with the bend.
        rigid: The motion of the same loop with a rigid frame.
    """

    bending: Motion
    rigid: Motion


def decay(design: Design, bend: BendModel) -> Decay:
    """March a scenario's controller in closed loop with the linear plant, bending and rigid, from small tilt rates.

    Observer, law, notch and rate limit are those of a run; the sensors keep their rates, latencies and low-pass, and
    lose noise, resolution and mounting errors. The plant is linearised upright, and marched exactly between samples.

    Args:
        design: The law and the observers.
        bend: The plant.

    Returns:
        The motions.
    """
    march = _March(design, bend)
    motions = march.motions(DURATION_S)
    if "swings" in motions:
        motions = march.motions(LONG_DURATION_S)
    return Decay(*motions)


class _March:
    """The closed loop of bending and rigid plants, a world for each start, (2, n_starts) worlds."""

    def __init__(self, design: Design, bend: BendModel) -> None:
        self._rig = design.rig
        self._controller = _quiet_controller(design)
        self._interval = self._controller.steps_per_sample * design.rig.timestep
        plants = (bend.bending, bend.rigid)
        F, G = zip(*(plant.held(self._interval) for plant in plants), strict=True)
        self._F, self._G, self._C = np.array(F), np.array(G), np.array([plant.C for plant in plants])
        tilt_rate = bend.bending.C[3]
        self._x = np.stack(2 * [np.outer(tilt_rate / (tilt_rate @ tilt_rate), STARTS_RAD_S)])
        self._u = np.zeros((2, 1, len(STARTS_RAD_S)))
        self._step = 0
        self._fell = np.zeros((2, len(STARTS_RAD_S)), bool)
        self._fall_angle = math.radians(design.scenario.metrics.fall_angle_deg)
        self._sizes: list[np.ndarray] = []

    def motions(self, until: float) -> list[Motion]:
        """March until a time [s], or until all have fallen, and judge the motions of both plants."""
        with np.errstate(all="ignore"):
            while not self._fell.all() and self._step * self._rig.timestep < until:
                self._sizes.append(self._window())
        sizes = np.array(self._sizes)  # (n_windows, 2 signals, 2 plants, n_starts)
        rest = np.array([NEGLIGIBLE_RAD_S, NEGLIGIBLE_RAD])[:, None, None]
        decays = np.all((sizes[-1] <= DECAY * sizes.max(axis=0)) | (sizes[-1] <= rest), axis=0) & ~self._fell
        return [_motion(*states) for states in zip(decays, self._fell, strict=True)]

    def _window(self) -> np.ndarray:
        """March over a window, and return the RMS of the tilt's rate and of the gimbals' angle."""
        ticks = max(round(WINDOW_S / self._interval), self._controller.period // self._controller.steps_per_sample)
        squares = np.zeros((2, *self._fell.shape))
        for _ in range(ticks):
            y1, acceleration, y2, rate, gyro = np.moveaxis(self._C @ self._x, 1, 0)
            fell = ~(np.abs(y1) < self._fall_angle)  # true where it is not a number
            self._fell |= fell
            squares += np.square([rate, y2])
            reading = _reading(self._rig.tilt, self._rig.gravity, *map(np.ravel, (y1, acceleration, y2, rate, gyro)))
            if self._controller.update(self._step, reading):
                self._u = np.reshape(self._controller.gimbal_rate, self._u.shape)
            self._x = np.where(self._fell[:, None, :], 0.0, self._F @ self._x + self._G @ self._u)
            self._step += self._controller.steps_per_sample
        return np.sqrt(squares / ticks)


def _motion(decays: np.ndarray, fell: np.ndarray) -> Motion:
    """Name the motion of one plant by those from its starts, (n_starts,)."""
    if decays[:SMALL_STARTS].all():
        return "decays" if decays.all() else "decays if small"
    return "falls" if fell.any() else "swings"


def _reading(
    tilt: RadialTilt, gravity: float, y1: Scalar, acceleration: Scalar, y2: Scalar, rate: Scalar, gyro: Scalar
) -> IdealReading:
    """What perfect sensors show of a motion about the pivot."""
    radial, across = gravity * np.cos(y1), -gravity * np.sin(y1)
    forces = [across + tilt.r_inner * acceleration, radial, across + tilt.r_outer * acceleration, radial]
    return IdealReading(np.array(forces), [y2], gyro, rate)


def _quiet_controller(design: Design) -> Controller:
    """Make the controller of a run with sensors that show what is there, for both plants and all starts."""
    settings = design.scenario.controller
    return make_controller(
        design.observer(),
        design.fresh_law(),
        _quiet(design.scenario.sensors),
        PlantInterface(design.rig.tilt, GimbalAngle((1.0,), (0.0,)), design.rig.timestep),
        worlds=range(2 * len(STARTS_RAD_S)),
        feedback=settings.feedback,
        angle_source=settings.angle_source,
        notch_hz=settings.notch_hz,
    )


def _quiet(sensors: Sensors) -> Sensors:
    """Return the sensors with their rates, latencies, ranges and low-passes, and without errors."""
    pair = replace(
        sensors.accelerometer,
        noise_density_ug_rthz=0.0,
        bias_mg=(0.0, 0.0),
        counts_per_g=0.0,
        scale_error=(0.0, 0.0),
        misalignment_deg=(0.0, 0.0),
        cross_axis=(0.0, 0.0),
        bias_instability_ug=0.0,
        vibration_mg=0.0,
        wheel_harmonics_mg=(),
    )
    encoder = replace(sensors.encoder, counts_per_revolution=0.0)
    fog = replace(sensors.fog, angle_random_walk_deg_rth=0.0, bias_deg_h=0.0)
    return replace(sensors, accelerometer=pair, encoder=encoder, fog=fog)
