"""Decides whether a loop around a frame that bends is stable: the controller at work on the linear plant."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from cmg_mj.controllers.make_controller import make_controller
from cmg_mj.core.controller import Controller, PlantInterface
from cmg_mj.core.tilt import GimbalAngle, RadialTilt
from cmg_mj.core.types import IdealReading
from cmg_mj.elementwise import Scalar
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.linear_plant import BendModel
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
REST = np.array([0.01, 0.005])[:, None, None]
"""Rate of the tilt [rad/s] and angle of the gimbals [rad] that count as rest unless they grow: noise causes more."""
GROWING_WINDOWS = 4
"""A size that rises over so many windows grows, however small it is, down to `TAIL` of its largest."""
TAIL = 0.003

Motion = Literal["decays", "decays if small", "swings", "falls"]
"""`decays if small`: it swings or falls with the scenario's own initial tilt, equilibrium bias and push.
`swings`: from a small start it neither decays nor falls."""


class Decay(NamedTuple):
    """The motions of a loop.

    Attributes:
        bending: The motion with the bend.
        rigid: The motion of the same loop with a rigid frame; None if it was not marched to its end.
    """

    bending: Motion
    rigid: Motion | None


def decay(design: Design, bend: BendModel, *, until_fall: bool = False) -> Decay:
    """March a scenario's controller in closed loop with the linear plant, bending and rigid.

    Observer, law, notch and rate limit are those of a run; the sensors keep their rates, latencies and low-pass, and
    lose noise, resolution and mounting errors. The plant is linearised upright and marched exactly between samples,
    but for its torque, which goes with the cosine of the gimbals' angle.

    It starts from small tilt rates, and once as the scenario does, with its strongest push.

    Args:
        design: The law and the observers.
        bend: The plant.
        until_fall: Whether a fall from a small start, with the bend, is all that matters.

    Returns:
        The motions.
    """
    march = _March(design, bend)
    march.advance(DURATION_S, until_fall)
    if until_fall and march.has_fallen:
        return Decay("falls", None)
    if march.is_undecided:
        march.advance(LONG_DURATION_S, until_fall)
    return Decay(*march.motions)


class _March:
    """The closed loop: a bending and a rigid plant for each small start, and for the scenario's own as the last."""

    def __init__(self, design: Design, bend: BendModel) -> None:
        scenario, self._rig = design.scenario, design.rig
        shape = 2, len(STARTS_RAD_S) + 1
        self._controller = _quiet_controller(design, math.prod(shape))
        self._interval = self._controller.steps_per_sample * design.rig.timestep
        plants = (bend.bending, bend.rigid)
        F, G = zip(*(plant.hold(self._interval) for plant in plants), strict=True)
        self._F, self._G, self._C = np.array(F), np.array(G), np.array([plant.C for plant in plants])
        rate = bend.bending.C[3] / (bend.bending.C[3] @ bend.bending.C[3])
        angles = int(np.argmax(bend.bending.A[0]))  # so many stand before their rates
        tilt = math.radians(scenario.plant.initial_tilt_deg) * np.roll(rate, -angles)
        starts = [*np.outer(STARTS_RAD_S, rate), tilt]
        self._x = np.stack(2 * [np.transpose(starts)])
        self._bias = np.zeros(shape)
        self._bias[:, -1] = math.radians(scenario.plant.equilibrium_bias_deg)
        impulses = [(push.torque_n_m * push.duration_s, push.duration_s) for push in scenario.push]
        impulse, push_s = max(impulses, key=lambda push: abs(push[0]), default=(0.0, self._interval))
        self._push_ends = PUSH_S + push_s
        self._push = np.zeros(shape)
        self._push[:, -1] = impulse / (push_s * design.rig.reduced.J1 * design.rig.reduced.gimbals)
        self._kick = self._interval * rate[:, None] * self._push[:, None, :]
        self._u, self._y2, self._fell = np.zeros(shape), np.zeros(shape), np.zeros(shape, bool)
        self._step = 0
        self._fall_angle = math.radians(scenario.metrics.fall_angle_deg)
        self._sizes: list[np.ndarray] = []

    @property
    def _time(self) -> float:
        return self._step * self._rig.timestep

    def advance(self, until: float, until_fall: bool) -> None:
        """March until a time [s], or until all have fallen, or one from a small start with the bend."""
        with np.errstate(all="ignore"):
            while not self._fell.all() and not (until_fall and self.has_fallen) and self._time < until:
                self._sizes.append(self._window())

    @property
    def has_fallen(self) -> bool:
        """True if the bending plant has fallen from a small start."""
        return bool(self._fell[0, :-1].any())

    @property
    def _decays(self) -> np.ndarray:
        """True for each motion that has decayed, (2, n_starts); of the scenario's own the tilt's rate alone counts."""
        sizes = np.array(self._sizes)
        largest, latest = sizes.max(axis=0), sizes[-GROWING_WINDOWS:]
        grows = (sizes[-1] > TAIL * largest) & (np.diff(latest, axis=0) > 0.0).all(axis=0)
        small = ((sizes[-1] <= DECAY * largest) | (sizes[-1] <= REST)) & (~grows | (len(sizes) < GROWING_WINDOWS))
        small[1, :, -1] = True
        return np.all(small, axis=0) & ~self._fell

    @property
    def is_undecided(self) -> bool:
        """True if a plant's small motions have neither all decayed nor grown."""
        first, last = self._sizes[0], self._sizes[-1]
        grown = np.any((last >= GROWTH * first) & (last > REST), axis=0) | self._fell
        waits = ~self._decays[:, :-1].all(axis=1) & ~grown[:, :-1].any(axis=1)
        return bool(waits.any())

    @property
    def motions(self) -> list[Motion]:
        """The motions of both plants."""
        return [_motion(*states) for states in zip(self._decays, self._fell, strict=True)]

    def _window(self) -> np.ndarray:
        """March over a window, and return the RMS of the tilt's rate and of the gimbals' angle."""
        controller = self._controller
        ticks = math.ceil(max(WINDOW_S, 4.0 * controller.law.dt) / self._interval)
        squares = np.zeros((2, *self._fell.shape))
        for _ in range(ticks):
            y1, acceleration, _, rate, gyro = np.moveaxis(self._C @ self._x, 1, 0)
            is_pushed = PUSH_S <= self._time < self._push_ends
            if is_pushed:
                acceleration = acceleration + self._push  # the accelerometers show it at once
            self._fell |= ~(np.abs(y1) < self._fall_angle)  # true where it is not a number
            squares += np.square([rate, self._y2])
            signals = (y1 - self._bias, acceleration, self._y2, rate, gyro)
            if controller.update(self._step, _reading(self._rig.tilt, self._rig.gravity, *map(np.ravel, signals))):
                self._u = np.reshape(controller.gimbal_rate, self._u.shape)
            x = self._F @ self._x + self._G * (self._u * np.cos(self._y2))[:, None, :]
            if is_pushed:
                x = x + self._kick
            self._x = np.where(self._fell[:, None, :], 0.0, x)
            self._y2 = np.where(self._fell, 0.0, self._y2 + self._interval * self._u)
            self._step += controller.steps_per_sample
        return np.sqrt(squares / ticks)


def _motion(decays: np.ndarray, fell: np.ndarray) -> Motion:
    """Name the motion of one plant by those from its starts, (n_starts,)."""
    if decays[:-1].all():
        return "decays" if decays[-1] else "decays if small"
    return "falls" if fell[:-1].any() else "swings"


def _reading(
    tilt: RadialTilt, gravity: float, y1: Scalar, acceleration: Scalar, y2: Scalar, rate: Scalar, gyro: Scalar
) -> IdealReading:
    """Return the readings of perfect sensors in a motion about the pivot."""
    radial, across = gravity * np.cos(y1), -gravity * np.sin(y1)
    forces = [across + tilt.r_inner * acceleration, radial, across + tilt.r_outer * acceleration, radial]
    return IdealReading(np.array(forces), [y2], gyro, rate)


def _quiet_controller(design: Design, worlds: int) -> Controller:
    """Make the controller of a run, in so many worlds, with sensors that show what is there."""
    settings = design.scenario.controller
    return make_controller(
        design.observer(),
        design.fresh_law(),
        _quiet(design.scenario.sensors),
        PlantInterface(design.rig.tilt, GimbalAngle((1.0,), (0.0,)), design.rig.timestep),
        worlds=range(worlds),
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
