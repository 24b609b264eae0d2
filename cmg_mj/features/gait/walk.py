"""A walk in the loop: the stage between the axes of a robot that stands on one foot or on two."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import mujoco
import numpy as np

from cmg_mj.core.arrays import clip, dot, where
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError
from cmg_mj.core.types import MultiAxisReading, Setpoints
from cmg_mj.features.gait import Gait
from cmg_mj.features.gait.lean import Lean
from cmg_mj.features.gait.legs import SIDES, Walk, plan_walk
from cmg_mj.features.gait.plan import Plan
from cmg_mj.features.gait.switches import FootSwitches
from cmg_mj.inputs.features import Judgement
from cmg_mj.plant.plant import Plant
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


def walking(gait: Gait, plant: Plant) -> Callable[[Controller], Walking] | None:
    """Make the stage between the axes; None without steps."""
    return (lambda first: Walking(planned(plant, gait), gait, plant, first)) if gait.steps else None


class Walking:
    """Moves the legs by the plan, and turns the gimbals of both axes as the feet allow.

    On one foot the axes are free, and each law's command is held. On two feet the robot tilts about the line of the
    feet alone, l, and not about n across it: the commands' part about it is held, and the gimbals' part across comes
    back to the middle. What the feet then add to f2 of the reduced models is -n (n . f2 + n . x2/`CAUGHT_S`).

    The torso's planned acceleration a makes accelerometers show a tilt of -a/g, which is taken off. The setpoints of
    the legs' servos run straight from tick to tick: their controls are the rates (`<intvelocity>`).
    """

    def __init__(self, walk: Walk, gait: Gait, plant: Plant, first: Controller) -> None:
        self._walk, self._dt = walk, first.law.dt
        self._switches = FootSwitches(gait, first)
        model = plant.filed.model
        sensors = [model.sensor(i).name for i in np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_TOUCH)]
        self._feet = [sensors.index(f"{side}/foot") for side in SIDES]
        self._models = [axis.reduced for axis in plant.axes]
        about = np.array([axis.direction[:2] for axis in plant.axes])  # the torso is level
        across = np.array([np.cross(axis.direction, axis.up)[:2] for axis in plant.axes])
        self._known = -walk.acceleration @ across.T / plant.gravity
        left, right = walk.feet[:, :, :2]
        self._lines = (left - right) / np.linalg.norm(left - right, axis=1)[:, None] @ about.T
        self._double = (walk.plan.load(walk.time) > 0.0).all(axis=0).astype(float)
        self._leaning = -walk.height * walk.leaning @ across.T
        zero = 0.0 if isinstance(first.world_ids, int) else np.zeros(len(first.world_ids))
        self._lean = Lean(self._models, self._dt, gait.lean_s, walk.height / plant.gravity, zero)

    def __call__(self, controllers: Sequence[Controller], ideals: MultiAxisReading) -> Setpoints:
        """Turn the gimbals, move the legs, and tell the controllers what they will know at the next tick."""
        dt, time = self._dt, (controllers[0].step or 0) * controllers[0].timestep
        left, right = self._switches([ideals.touch[i] for i in self._feet])
        both = left & right
        line = self._at(self._lines, time)
        across = np.array([-line[1], line[0]])
        ticks = [part.tick for part in controllers if part.tick is not None]
        held = dot(line.tolist(), [tick.u for tick in ticks])
        back = -dot(across.tolist(), [tick.y2 for tick in ticks]) / RECENTRED_S
        for i, part in enumerate(controllers):
            limit = part.law.rate_limit
            u = clip(where(both, line[i] * held + across[i] * back, ticks[i].u), -limit, limit)
            part.tick = ticks[i] = ticks[i]._replace(u=u)
        caught = []
        for model, tick in zip(self._models, ticks, strict=True):
            x1, x2, x3 = tick.estimates[0][:3]
            caught.append(model.tilt_acceleration(x1, x2, x3, tick.u) + x2 / CAUGHT_S)
        contact = where(both, -dot(across.tolist(), caught), 0.0)
        before = self._lean.lean.copy()
        self._lean.update(ticks, line, both, bool(self._at(self._double, time) >= 1.0))
        known = self._at(self._known, time + 0.5 * dt)  # a sample is the mean since the one before
        for i, part in enumerate(controllers):
            part.known_tilt = known[i] + self._lean.known_tilt[i]
            part.bias = self._lean.bias[i] - self._lean.lean[i]
            part.contact = across[i] * contact
            part.command_rate(ticks[i].u)
        return self._walk.servos.tolist(), self._legs(time, before, self._lean.lean)

    def _legs(self, time: float, before: Sequence[float], after: Sequence[float]) -> np.ndarray:
        """Return the rates at which the servos' setpoints run until the next tick, (6,) or (6, n_worlds)."""
        ends = []
        for at, leans in ((time, before), (time + self._dt, after)):
            moved = map(np.multiply.outer, leans, self._at(self._leaning, at).T)
            ends.append(sum(moved, self._at(self._walk.setpoints, at)))
        return ((ends[1] - ends[0]) / self._dt).T

    def _at(self, table: np.ndarray, time: float) -> np.ndarray:
        """Read a table of the plan at a time [s]; after its end it stays."""
        i = min(int(time / PLAN_S + 1e-9), len(table) - 2)
        part = min(time / PLAN_S - i, 1.0)
        return (1.0 - part) * table[i] + part * table[i + 1]
