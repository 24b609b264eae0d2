"""Limits of a pair on a robot: for any controller, for this one on the reduced model, and for what carries it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axis import KnownPlant
from cmg_mj.core.loop import ControlLoop, Joints
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import GimbalAngle
from cmg_mj.core.types import IdealReading
from cmg_mj.features.mounting.stance import simulated_pole
from cmg_mj.linear.ceiling import PUSH_S, RecoverableLimit, ceiling
from cmg_mj.linear.verdict import SlidingPoles, sliding_poles
from cmg_mj.plant.mjcf import quiet, set_control_callback
from cmg_mj.plant.plant import Plant
from cmg_mj.runs.batch import stack_worlds
from cmg_mj.runs.experiment import Experiment
from cmg_mj.scenario.design import Design, PlantNumbers
from cmg_mj.scenario.time_grid import common_period
from cmg_mj.stages.push import Push, Pushes

WORLDS = 10
LEVELS = 24
"""Pushes tried at once, and then as many between the largest tolerated one and the next."""
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


def push_margin(design: Design) -> PushMargin:
    """Find the largest push from which the law, the observer and the sensors of a scenario recover together.

    The plant is the reduced model (4), upright, its gimbals turning as commanded.

    Args:
        design: The scenario with its sensors, its rates and its fall angle; the law and the observer for the plant.

    Returns:
        The largest pushes.
    """
    high = 1.5 * ceiling(design.rig.reduced, design.law.rate_limit).push_impulse(PUSH_S)
    coarse = _largest_push(design, np.linspace(0.0, high, LEVELS))
    if coarse is None:
        return PushMargin(0.0, 0.0)
    step = high / (LEVELS - 1)
    least, most = max(coarse.worst_impulse - step, 0.0), coarse.median_impulse + step
    return _largest_push(design, np.linspace(least, most, LEVELS)) or coarse


def _largest_push(design: Design, impulses: np.ndarray) -> PushMargin | None:
    """Find each world's largest push up to which it stood all; None if most fell with the first."""
    stood = _stands(design, impulses)
    count = np.where(stood.all(axis=1), len(impulses), np.argmin(stood, axis=1)) - 1  # per world
    if np.median(count) < 0:
        return None
    largest = np.where(count < 0, 0.0, impulses[np.maximum(count, 0)])
    return PushMargin(float(np.median(largest)), largest.min())


def _stands(design: Design, impulses: np.ndarray) -> np.ndarray:
    """Find which worlds stand which pushes, (WORLDS, n_impulses)."""
    scenario, plant, model = design.scenario, design.rig, design.rig.reduced
    h = common_period(scenario.model_copy(update={"push": [], "duration_s": 1.0}))
    alone = dataclasses.replace(design, scenario=scenario.model_copy(update={"open_loop_observers": []}))
    gimbal_angle = GimbalAngle((1.0,) * model.gimbals, (0.0,) * model.gimbals)
    numbers = np.repeat(np.arange(WORLDS), len(impulses)).tolist()
    controller = alone.controller(KnownPlant(plant.tilt, gimbal_angle, h), world_ids=numbers)
    physics = ReducedPhysics(plant, len(numbers), h)
    after = AFTER_TIME_CONSTANTS / ceiling(model, design.law.rate_limit).pole
    steps = math.ceil((BEFORE_S + PUSH_S + after) / h)
    end = -(-steps // controller.steps_per_sample) * controller.steps_per_sample
    start, duration = round(BEFORE_S / h) * h, round(PUSH_S / h) * h
    push = stack_worlds([Push(start, duration, torque) for torque in (impulses / PUSH_S).tolist()] * WORLDS)
    fall_angle = math.radians(scenario.metrics.fall_angle_deg)
    loop = ControlLoop(physics, controller, end, [Pushes([push], h, [""])], fall_angle)
    with np.errstate(all="ignore"):
        for _ in loop.ticks():
            loop.decide()
            loop.advance()
        physics.stop_fallen(physics.x[0], fall_angle)
    return ~physics.fallen.reshape(WORLDS, len(impulses))


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

    def __init__(self, plant: PlantNumbers, n_worlds: int, timestep: float) -> None:
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
        across, up = -gravity * np.sin(x1), gravity * np.cos(x1)
        if self._plant.reduced.pivot_arm:
            sliding = self._plant.reduced.pivot_acceleration(x1, x2, alpha)
            across, up = across + sliding * np.cos(x1), up + sliding * np.sin(x1)
        forces = np.stack(tilt.about(-tilt.height).forces(across, up, alpha, x2))
        return IdealReading(forces, [x3.copy()] * self._plant.reduced.gimbals, x2.copy(), x2.copy())

    def push(self, torques: Sequence[Scalar]) -> Sequence[Scalar]:
        """Set the torque about the line, (n_worlds,) [N m]."""
        (self._torque,) = torques
        return torques

    def accelerate(self, acceleration: Sequence[Scalar]) -> None:
        """Refuse: the pivot of the reduced model is not driven."""
        raise NotImplementedError

    def control(self, actuators: Sequence[int], setpoints: np.ndarray) -> None:
        """Refuse: the reduced model has no other actuators."""
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


LOW_LIMIT_DEG = 2.0
"""A pair that recovers less tilt is too small for the robot [deg]."""
START_DEG, START_SHARE = 1.0, 0.25
"""A run starts with one degree of tilt, or with a quarter of the recoverable tilt if that is less."""
POLE_DIFFERENCE = 0.1
"""Relative difference of the simulated pole from the reduced model's, from which the robot is unlike that model."""
NOISY = 0.75
"""Share of E. If the worst world of the reduced model recovers from less, the sensors' noise alone may fell a robot."""


@dataclass(frozen=True)
class PushLimits:
    """Limits of a pair on a robot.

    Attributes:
        reduced: The robot's reduced model.
        limit: Limits for any controller.
        push_margin: Pushes that the scenario's law, observer and sensors recover from.
        pole: Unstable pole of the simulated robot, uncontrolled and with its flywheels at rest [1/s].
        sliding_poles: Slowest poles of the loop of a rig whose pivot slides freely; None for a pivot at rest.
    """

    reduced: ReducedModel
    limit: RecoverableLimit
    push_margin: PushMargin
    pole: float
    sliding_poles: SlidingPoles | None = None

    @property
    def limit_push_impulse(self) -> float:
        """Impulse of the largest push of 0.1 s that any controller recovers from [N m s]; E cannot exceed it."""
        return self.limit.push_impulse(PUSH_S)

    @property
    def fraction_of_limit(self) -> float:
        """The push margin E, in shares of the limit for any controller."""
        return self.push_margin.median_impulse / self.limit_push_impulse

    @property
    def noisy(self) -> bool:
        """True if the sensors' noise alone may fell the robot, by its reduced model."""
        return self.push_margin.worst_impulse < NOISY * self.push_margin.median_impulse

    @property
    def start_tilt_deg(self) -> float:
        """The tilt that a run of the robot starts with [deg]."""
        return float(f"{min(START_DEG, START_SHARE * math.degrees(self.limit.tilt)):.3g}")

    @property
    def hints(self) -> list[str]:
        """Clauses on what is likely to make the robot fall, though it is no mistake."""
        hints = []
        if not abs(self.pole / self.limit.pole - 1.0) < POLE_DIFFERENCE:
            hints.append(
                f"the robot starts to fall with a pole of {self.pole:.3g} 1/s, its reduced model's is "
                f"{self.limit.pole:.3g}: its support rolls or is soft (soft contacts, or joints held softly), the "
                "hinge that it tilts about has a spring or damping, or geoms overlap"
            )
        if self.noisy:
            share = self.push_margin.worst_impulse / self.push_margin.median_impulse
            hints.append(
                "the pair is so small that the sensors' noise alone may fell the robot (its reduced model's worst "
                f"world recovers from {share:.0%} of E)"
            )
        if self.push_margin.median_impulse == 0.0:
            hints.append("with this controller it falls without a push")
        return hints

    def figures(self) -> dict[str, float]:
        """Return the figures by name, as `cmg-mj mount --json` prints them."""
        model = self.reduced
        n, poles = model.gimbals, self.sliding_poles
        figures = {
            "inertia_kg_m2": n * model.J1,
            "gravity_torque_n_m": n * model.gravity_torque,
            "momentum_n_m_s": n * model.J_d * model.omega_d,
            "pole_1_s": self.limit.pole,
            "pole_simulated_1_s": self.pole,
            "limit_tilt_deg": math.degrees(self.limit.tilt),
            "limit_impulse_n_m_s": self.limit.impulse,
            "limit_push_impulse_n_m_s": self.limit_push_impulse,
            "limit_push_torque_n_m": self.limit_push_impulse / PUSH_S,
            "push_margin_impulse_n_m_s": self.push_margin.median_impulse,
            "push_margin_worst_impulse_n_m_s": self.push_margin.worst_impulse,
            "push_margin_torque_n_m": self.push_margin.median_impulse / PUSH_S,
        }
        if poles:
            figures |= {"pivot_arm_m": model.pivot_arm}
            figures |= {f"pole_tilt_{name}_1_s": pole for name, pole in poles._asdict().items()}
        return figures


def push_limits(experiment: Experiment, axis: str = "") -> PushLimits:
    """Find the limits of a pair on a robot, by its reduced model.

    Args:
        experiment: The robot and its controller.
        axis: Name of the axis, if there are several.

    Returns:
        The limits.
    """
    part = next((part for part in experiment.axes if part.name == axis), experiment.axes[0])
    plant = part.plant
    limit = ceiling(plant.reduced, part.law.rate_limit)
    with set_control_callback(None), quiet():
        pole = simulated_pole(plant.model, plant.key, plant.axis.line, plant.axis.bias)
    margin = push_margin(part.design)
    poles = sliding_poles(part.law, plant)
    return PushLimits(plant.reduced, limit, margin, pole, poles)


SPIN_UP_S = 60.0
"""Time in which the wheels come up to speed [s]."""
BEARINGS = 2
"""Bearings of a wheel."""
FRICTION = 0.0015
"""Coefficient of friction of deep groove ball bearings without contact seals: M = 0.5 mu P d, for loads P of about a
tenth of the rating C and good lubrication. SKF, catalogue Rolling bearings, chapter Friction, "Estimating the
frictional moment", table 1."""
BORE_M, RATING_N = 0.008, 3300.0
"""Bore d and dynamic load rating C of a 608 (makers give 3.3 to 3.45 kN), which fits the shaft of a wheel of the
papers' size. That its load, the preload, is a tenth of C is an assumption too. A module of scale s has bearings of s
times the bore and s^2 times the rating."""


class PairDemands(NamedTuple):
    """Demands of a pair on its robot, by the names that `cmg-mj mount --json` prints."""

    pair_mass_kg: float
    """Mass of the modules."""
    robot_mass_kg: float
    """Mass of the robot without them."""
    servo_limit_torque_n_m: float
    """Largest torque that a gimbal servo has."""
    servo_limit_rate_rad_s: float
    """Largest rate that the gimbals are commanded."""
    wheels_energy_j: float
    """Energy of the wheels at their speed, J w^2/2 each."""
    wheels_spin_up_power_w: float
    """Mean power of a spin-up in a minute, against inertia alone."""
    wheels_holding_power_assumed_w: float
    """Power that keeps the wheels turning: assumed friction of their bearings, since the model's have none; no drag of
    the air."""


def pair_demands(plant: Plant, rate_limit: float, scale: float) -> PairDemands:
    """Read the demands of a pair off its plant.

    Args:
        plant: The robot, as the pair's axis sees it.
        rate_limit: Largest rate that the law commands [rad/s].
        scale: Scale of the modules' lengths.

    Returns:
        The demands.
    """
    model, modules = plant.model, plant.axis.modules
    mass = sum(model.body_subtreemass[model.body(f"{module.name}/half").id] for module in modules)
    robot = model.body_subtreemass[model.body_rootid[plant.axis.frame]] - mass
    torque = min(model.actuator_forcerange[module.servo, 1] for module in modules)
    energy = sum(0.5 * plant.axis.reduced.J_d * module.speed**2 for module in modules)
    moment = BEARINGS * 0.5 * FRICTION * 0.1 * RATING_N * BORE_M * scale**3
    power = sum(moment * abs(module.speed) for module in modules)
    return PairDemands(mass, robot, torque, rate_limit, energy, energy / SPIN_UP_S, power)
