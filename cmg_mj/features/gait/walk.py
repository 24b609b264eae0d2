"""A walk in the loop: the stage between the axes of a robot that stands on one foot or on two."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.arrays import Scalar, clip, dot, where
from cmg_mj.core.axis import AxisControl, Tick
from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.rig import AxesOrders, AxesStage
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import MultiAxisReading
from cmg_mj.features.gait import Gait
from cmg_mj.features.gait.figures import WalkFigures, walk_series
from cmg_mj.features.gait.lean import Lean, Leaning
from cmg_mj.features.gait.legs import SIDES, Walk, plan_walk
from cmg_mj.features.gait.plan import Plan
from cmg_mj.features.gait.switches import Foot, FootSwitches, foot_switches
from cmg_mj.inputs.features import Judgement
from cmg_mj.plant.axis import Axis
from cmg_mj.plant.plant import Plant
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.schema import Scenario

PLAN_S = 0.005
"""Time between two points of a plan [s]."""
RECENTRED_S = 0.5
"""Time constant in which gimbals come back that turn nothing: the feet hold that direction [s]."""
LEAST_LEAN_S = 0.2
"""A torso moved faster shakes its accelerometers [s]."""
CAUGHT_S = 0.02
"""Time constant in which a rate that the feet hold leaves the observers' model [s]."""


def planned(plant: Plant, gait: Gait) -> Walk:
    """Plan a walk for a plant as its file has it: no equilibrium bias is known."""
    return _planned(plant.filed.model, plant.key, gait)


@lru_cache(maxsize=8)
def _planned(model: mujoco.MjModel, key: int, gait: Gait) -> Walk:
    return plan_walk(model, key, gait, PLAN_S)


def check_gait(scenario: Scenario, plant: Plant) -> None:
    """Refuse a gait that the plant cannot walk.

    Raises:
        InputError: The plant is no such robot, its legs do not reach so far, the run is too short, or something else
            moves the legs.
    """
    gait: Gait = scenario.section("gait")
    if not gait.steps:
        if gait.tiles_m:
            raise InputError(f"gait.tiles_m = {gait.tiles_m:g}: are laid along a walk; set gait.steps")
        return
    stands = Plan(gait, 0.0).duration_s - gait.stand_s
    if stands > scenario.duration_s + 1e-9:
        raise InputError(
            f"gait.steps = {gait.steps}: end at {stands:g} s, and duration_s = {scenario.duration_s:g}; make it "
            "longer, or take fewer steps"
        )
    if 0.0 < gait.lean_s < LEAST_LEAN_S:
        raise InputError(f"gait.lean_s = {gait.lean_s:g}: must be 0 or at least {LEAST_LEAN_S:g}")
    walk = planned(plant, gait)
    if len(plant.axes) != 2:
        raise InputError(f"gait.steps = {gait.steps}: takes a robot that tilts about two axes")
    legs = {plant.model.actuator(i).name for i in walk.servos}
    for i, track in enumerate(scenario.feature_sections.get("track", ())):
        from cmg_mj.features.track.motion import read_columns  # only where there is such a feature

        if both := legs.intersection(read_columns(track.files[0]).names):
            raise InputError(
                f"track.{i}.file: moves {sorted(both)[0]}, as [gait] does; leave that column or gait.steps out"
            )


def describe_gait(design: Design, plant: Plant) -> Judgement:
    """Describe the walk."""
    gait: Gait = design.scenario.section("gait")
    if not gait.steps:
        return Judgement()
    walk, sensor = planned(plant, gait), design.scenario.sensors.accelerometer
    way = walk.feet[:, -1, 0].max() - walk.feet[:, 0, 0].max()
    row = f"{gait.steps} steps, {way:.3g} m, until {walk.plan.duration_s - gait.stand_s:g} s"
    hints = (
        []
        if sensor.averaged
        else [
            "[gait]: the legs' servos shake accelerometers that show instants; "
            "set sensors.accelerometer.averaged = true"
        ]
    )
    return Judgement([("gait", row)], hints)


def walking(gait: Gait, plant: Plant, axes: Sequence[AxisControl]) -> Walking | None:
    """Make the stage between the axes; None without steps."""
    if not gait.steps:
        return None
    walk, dt = planned(plant, gait), axes[0].law.dt
    models = [axis.reduced for axis in plant.axes]
    lean = Lean(models, dt, gait.lean_s, walk.height / plant.gravity)
    limits = [axis.law.rate_limit for axis in axes]
    course = Course(walk, plant, dt, axes[0].period)
    model = plant.filed.model
    sensors = [model.sensor(i).name for i in np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_TOUCH)]
    feet = [sensors.index(f"{side}/foot") for side in SIDES]
    return Walking(walk, feet, foot_switches(gait, dt), lean, models, limits, dt, course)


class Course:
    """The plan of a walk as a table: its numbers at each control tick; after its end they stay.

    Args:
        walk: The plan.
        plant: The robot.
        dt: Control period [s].
        period: Physics steps in a control period.
    """

    def __init__(self, walk: Walk, plant: Plant, dt: float, period: int) -> None:
        about = np.array([axis.direction[:2] for axis in plant.axes])  # the torso is level
        across = np.array([np.cross(axis.direction, axis.up)[:2] for axis in plant.axes])
        known = -walk.acceleration @ across.T / plant.gravity
        left, right = walk.feet[:, :, :2]
        lines = (left - right) / np.linalg.norm(left - right, axis=1)[:, None] @ about.T
        double = (walk.plan.load(walk.time) > 0.0).all(axis=0).astype(float)
        leaning = -walk.height * walk.leaning @ across.T
        self._period = period
        ticks = math.ceil(walk.time[-1] / dt) + 2
        times = period * np.arange(ticks) * plant.timestep
        columns = [
            _at(lines, times),
            (_at(double[:, None], times) >= 1.0).astype(float),
            _at(known, times + 0.5 * dt),  # a sample is the mean since the one before
        ]
        for ends in (times, times + dt):
            columns += [_at(walk.setpoints, ends), *np.moveaxis(_at(leaning, ends), 2, 0)]
        self._rows = np.hstack(columns)

    def __call__(self, step: int) -> list[float]:
        """Return the numbers at a physics step.

        The line of the feet (2), whether both stand (1), the known tilt (2); of now, and of the next tick: setpoints
        (6), and by how much each moves with the lean about the first axis (6) and about the second one (6).
        """
        return self._rows[min(step // self._period, len(self._rows) - 1)].tolist()


def _at(table: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Read a table of the plan, (n_points, ...), at times [s]; after its end it stays."""
    i = np.minimum((times / PLAN_S + 1e-9).astype(int), len(table) - 2)
    part = np.minimum(times / PLAN_S - i, 1.0).reshape(-1, *[1] * (table.ndim - 1))
    return (1.0 - part) * table[i] + part * table[i + 1]


class WalkMemory(NamedTuple):
    """The memory of `Walking`."""

    tick: int
    """Ticks taken."""
    feet: tuple[Foot, ...]
    leaning: Leaning


@dataclass(frozen=True)
class Walking(AxesStage):
    """Moves the legs by the plan, and turns the gimbals of both axes as the feet allow.

    On one foot the axes are free, and each law's command is held. On two feet the robot tilts about the line of the
    feet alone, l, and not about n across it: the commands' part about it is held, and the gimbals' part across comes
    back to the middle. What the feet then add to f2 of the reduced models is -n (n . f2 + n . x2/`CAUGHT_S`).

    The torso's planned acceleration a makes accelerometers show a tilt of -a/g, which is taken off. The setpoints of
    the legs' servos run straight from tick to tick: their controls are the rates (`<intvelocity>`).

    Attributes:
        walk: The plan, with the legs' servos.
        feet: Which of the touch sensors are the feet's.
        switches: The foot switches.
        lean: Finds the equilibrium bias, and moves the torso.
        models: The reduced model of each axis.
        limits: Largest gimbal rate of each axis [rad/s].
        dt: Control period [s].
        course: The plan as a table.
    """

    walk: Walk
    feet: Sequence[int]
    switches: FootSwitches
    lean: Lean
    models: Sequence[ReducedModel]
    limits: Sequence[Scalar]
    dt: float
    course: Course

    @property
    def actuators(self) -> Sequence[int]:
        """See `AxesStage`."""
        return self.walk.servos.tolist()

    @property
    def draws(self) -> Mapping[int, int]:
        """See `AxesStage`."""
        return self.switches.draws

    @property
    def tables(self) -> dict[str, Course]:
        """See `AxesStage`."""
        return {"walk": self.course}

    def sums(self, plant: Plant, n_worlds: int) -> WalkFigures:
        """See `AxesStage`: steps, distance, energy."""
        return WalkFigures(self.walk, plant, n_worlds, self.dt)

    def series(self, plant: Plant) -> Callable[[Axis, Trajectory], dict[str, np.ndarray]]:
        """See `AxesStage`: the plan beside what came of it."""
        return walk_series(self.walk, plant)

    def init(self, readings: MultiAxisReading, tables: Tables) -> WalkMemory:
        """Return the memory before the first tick."""
        forces = [readings.touch[i] for i in self.feet]
        return WalkMemory(0, self.switches.init(forces), self.lean.init(0.0 * forces[0]))

    def step(
        self,
        memory: WalkMemory,
        step: int,
        orders: AxesOrders,
        ticks: Sequence[Tick],
        readings: MultiAxisReading,
        tables: Tables,
    ) -> tuple[WalkMemory, AxesOrders]:
        """Turn the gimbals, move the legs, and tell the controllers what they will know at the next tick."""
        course = tables["walk"](step)
        line, (planned, *known), ends = course[:2], course[2:5], (course[5:23], course[23:])
        across = [-line[1], line[0]]
        forces = [readings.touch[i] for i in self.feet]
        feet, (left, right) = self.switches.step(memory.feet, forces, memory.tick, tables)
        both = left * right
        stand = both > 0.5
        held = dot(line, orders.told)
        back = -dot(across, [tick.y2 for tick in ticks]) / RECENTRED_S
        told, caught = [], []
        for i, tick in enumerate(ticks):
            limit = self.limits[i]
            u = clip(where(stand, line[i] * held + across[i] * back, orders.told[i]), -limit, limit)
            x1, x2, x3 = tick.estimates[0][:3]
            told.append(u)
            caught.append(self.models[i].tilt_acceleration(x1, x2, x3, u) + x2 / CAUGHT_S)
        contact = where(stand, -dot(across, caught), 0.0)
        leaning = self.lean.step(memory.leaning, ticks, told, line, both, planned)
        knowing = []
        for i, before in enumerate(orders.known):
            tilt = known[i] + leaning.known_tilt[i]
            bias = leaning.bias[i] - leaning.lean[i]
            knowing.append(
                before._replace(tilt=before.tilt + tilt, bias=before.bias + bias, contact=across[i] * contact)
            )
        legs = self._legs(ends, memory.leaning.lean, leaning.lean)
        after = WalkMemory(memory.tick + 1, feet, leaning)
        return after, AxesOrders(told, told, knowing, [*orders.setpoints, *legs])

    def _legs(self, ends: Sequence[Sequence[float]], before: Sequence[Scalar], after: Sequence[Scalar]) -> list[Scalar]:
        """Return the rates at which the servos' setpoints run until the next tick."""
        rates = []
        n = len(self.walk.servos)
        for i in range(n):
            begin, end = (
                plan[i] + lean[0] * plan[n + i] + lean[1] * plan[2 * n + i]
                for plan, lean in zip(ends, (before, after), strict=True)
            )
            rates.append((end - begin) / self.dt)
        return rates
