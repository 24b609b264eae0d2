"""Finds the largest push that a loop recovers from, on the reduced model with the sensors' noise."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.controller import PlantInterface
from cmg_mj.core.loop import ControlLoop, Joints
from cmg_mj.core.outside import Outside
from cmg_mj.core.tilt import GimbalAngle
from cmg_mj.core.types import IdealReading
from cmg_mj.features.mounting.recoverable_states import ceiling
from cmg_mj.scenario.design import Design, PlantParameters
from cmg_mj.scenario.schema import Scenario
from cmg_mj.scenario.time_grid import common_period

WORLDS = 10
LEVELS = 24
"""Pushes tried at once, and then as many between the largest tolerated one and the next."""
PUSH_S = 0.1
BEFORE_S = 1.0
"""The loop runs for so long before the push comes [s]."""
AFTER_TIME_CONSTANTS = 10.0
"""Time constants of the rig's unstable pole after which the rig has recovered or fallen."""


class PushMargin(NamedTuple):
    """The largest pushes that a loop recovers from."""

    median_impulse: float
    """E: the largest impulse about the line, as a push of 0.1 s, that it recovers from, the median of ten worlds
    [N m s]. 0 if it falls without one."""
    worst_impulse: float
    """Largest impulse in the worst of the worlds [N m s]."""


def push_margin(scenario: Scenario, design: Design) -> PushMargin:
    """Find the largest push from which the law, the observer and the sensors of a scenario recover together.

    The plant is the reduced model (4), upright, its gimbals turning as commanded.

    Args:
        scenario: For its sensors, its rates and its fall angle.
        design: The law and the observer for the plant.

    Returns:
        The largest pushes.
    """
    low, high = 0.0, 1.5 * ceiling(design.rig.reduced, design.law.rate_limit).push_impulse(PUSH_S)
    coarse = _largest_push(scenario, design, np.linspace(low, high, LEVELS))
    if coarse is None:
        return PushMargin(0.0, 0.0)
    step = high / (LEVELS - 1)
    least, most = max(coarse.worst_impulse - step, 0.0), coarse.median_impulse + step
    return _largest_push(scenario, design, np.linspace(least, most, LEVELS)) or coarse


def _largest_push(scenario: Scenario, design: Design, impulses: np.ndarray) -> PushMargin | None:
    """Find each world's largest push up to which it stood all; None if most fell with the first."""
    stood = _stands(scenario, design, impulses)
    count = np.where(stood.all(axis=1), len(impulses), np.argmin(stood, axis=1)) - 1  # per world
    if np.median(count) < 0:
        return None
    largest = np.where(count < 0, 0.0, impulses[np.maximum(count, 0)])
    return PushMargin(float(np.median(largest)), float(largest.min()))


def _stands(scenario: Scenario, design: Design, impulses: np.ndarray) -> np.ndarray:
    """Find which worlds stand which pushes, (WORLDS, n_impulses)."""
    plant = design.rig
    model = plant.reduced
    h = common_period(scenario.model_copy(update={"push": [], "duration_s": 1.0}))
    alone = dataclasses.replace(design, scenario=scenario.model_copy(update={"open_loop_observers": []}))
    gimbal_angle = GimbalAngle((1.0,) * model.gimbals, (0.0,) * model.gimbals)
    numbers = np.repeat(np.arange(WORLDS), len(impulses)).tolist()
    controller = alone.controller(PlantInterface(plant.tilt, gimbal_angle, h), worlds=numbers)
    physics = ReducedPhysics(plant, len(numbers), h)
    after = AFTER_TIME_CONSTANTS / ceiling(model, design.law.rate_limit).pole
    steps = math.ceil((BEFORE_S + PUSH_S + after) / h)
    pushed = range(round(BEFORE_S / h), round((BEFORE_S + PUSH_S) / h))
    push, none = (np.tile(impulses / PUSH_S, WORLDS),), (np.zeros(len(numbers)),)
    end = -(-steps // controller.steps_per_sample) * controller.steps_per_sample
    fall_angle = math.radians(scenario.metrics.fall_angle_deg)
    loop = ControlLoop(physics, controller, end, [_Held(push, none, pushed)], fall_angle)
    with np.errstate(all="ignore"):
        for _ in loop.ticks():
            loop.decide()
            loop.advance()
        physics.stop_fallen(physics.x[0], fall_angle)
    return ~physics.fallen.reshape(WORLDS, len(impulses))


class _Held:
    """Torques that are held from one step to another: a `Disturbance`."""

    edges = ()
    accelerates = False

    def __init__(self, push: Sequence[Scalar], none: Sequence[Scalar], pushed: range) -> None:
        self._push, self._none, self._pushed = push, none, pushed

    def __call__(self, step: int, steps: int, outside: Outside) -> Outside:
        return Outside(self._push if step in self._pushed else self._none)


class ReducedPhysics:
    """Steps many worlds of the reduced model (4), whose gimbals turn as commanded; see `core.loop.Physics`.

    Args:
        plant: The plant's parameters.
        n_worlds: How many worlds; each starts upright and at rest.
        timestep: Physics step [s].

    Attributes:
        x: The state: tilt, tilt rate, gimbal angle, (3, n_worlds) [rad, rad/s, rad].
        fallen: Which worlds have fallen, (n_worlds,); their state stays zero.
    """

    any_running = True
    running = None
    stop_failed = None  # a world without a finite command falls

    def __init__(self, plant: PlantParameters, n_worlds: int, timestep: float) -> None:
        self._plant, self._timestep = plant, timestep
        self.x = np.zeros((3, n_worlds))
        self.fallen = np.zeros(n_worlds, dtype=bool)
        self._u = self._torque = np.zeros(n_worlds)

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return x for joint angles and rates."""
        return self.x, self.x

    def tilt(self, qpos: Joints, /) -> Scalar:
        """Return x1."""
        return qpos[0]

    def reading(self, v: Joints) -> IdealReading:
        """Compute what perfect sensors show on a rigid body that tilts about a line, which may slide."""
        (x1, x2, x3), tilt, gravity = self.x, self._plant.tilt, self._plant.gravity
        alpha = self._slope(self.x)[1]
        forces = np.stack(
            [
                part
                for r in tilt.radii
                for part in (r * alpha - gravity * np.sin(x1), gravity * np.cos(x1) - r * x2 * x2)
            ]
        )
        if self._plant.reduced.pivot_arm:
            sliding = self._plant.reduced.pivot_acceleration(x1, x2, alpha)
            forces = forces + np.stack([sliding * np.cos(x1), sliding * np.sin(x1)] * 2)
        return IdealReading(forces, [x3.copy()] * self._plant.reduced.gimbals, x2.copy(), x2.copy())

    def push(self, torques: Sequence[Scalar]) -> Sequence[Scalar]:
        """Set the torque about the line, (n_worlds,) [N m]."""
        (self._torque,) = torques
        return torques

    def accelerate(self, acceleration: Sequence[Scalar]) -> None:
        """Refuse: the pivot of the reduced model is not driven."""
        raise NotImplementedError

    def command(self, u: Scalar, axis: int = 0) -> None:
        """Set the gimbal rate, (n_worlds,) [rad/s]."""
        self._u = np.asarray(u)

    def advance(self, steps: int) -> None:
        """Take one step of RK4 over so many physics steps, with command and torque held."""
        h, x = steps * self._timestep, self.x
        k1 = self._slope(x)
        k2 = self._slope(x + 0.5 * h * k1)
        k3 = self._slope(x + 0.5 * h * k2)
        k4 = self._slope(x + h * k3)
        self.x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    def stop_fallen(self, tilt: Scalar, limit: float) -> Sequence[tuple[int, float]]:
        """Hold fallen worlds at zero; the loop goes on without an ending."""
        self.fallen |= ~(np.abs(tilt) < limit)
        self.x[:, self.fallen] = 0.0
        return ()

    def _slope(self, x: np.ndarray) -> np.ndarray:
        """Compute x' of (4) under the present command and torque."""
        model = self._plant.reduced
        x1, x2, x3 = x
        acceleration = model.tilt_acceleration(x1, x2, x3, self._u) + self._torque / (model.gimbals * model.inertia(x3))
        return np.stack([x2, acceleration, self._u])
