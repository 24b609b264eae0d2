"""Figures of a walk: steps, distance, energy; and the plan beside what came of it."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from cmg_mj.core.loop import Joints
from cmg_mj.features.gait.legs import SIDES, Walk
from cmg_mj.plant.axis import Axis
from cmg_mj.plant.plant import Plant
from cmg_mj.results.summary_keys import Figures
from cmg_mj.results.trajectory import Trajectory

STOOD_S = 0.5
"""A step counts if the robot has not fallen so long after it was to land [s]."""


class WalkFigures:
    """Sums over the ticks of one or many worlds.

    Args:
        walk: The plan.
        plant: The robot.
        n_worlds: Number of worlds.
        dt: Control period [s].
    """

    def __init__(self, walk: Walk, plant: Plant, n_worlds: int, dt: float) -> None:
        self._lands, self._dt = np.array([step.lands for step in walk.plan.steps]), dt
        self._place = int(plant.filed.model.jnt_qposadr[_free_joint(plant)])
        self._actuators = {"gimbal": [servo for axis in plant.axes for servo in axis.servos], "leg": list(walk.servos)}
        self._work = {name: np.zeros(n_worlds) for name in self._actuators}
        self._end = np.zeros(n_worlds)
        self._start = self._last = np.zeros((2, n_worlds))

    def add(self, time: float, q: Joints, power: np.ndarray, running: np.ndarray | None) -> None:
        """Take a tick.

        Args:
            time: [s].
            q: Joint positions at it.
            power: Of each actuator, at its end, (n,) or (n, n_worlds) [W].
            running: Which worlds have not ended, (n_worlds,); None for one world.
        """
        going = np.ones(1, dtype=bool) if running is None else running
        place = np.reshape([q[self._place], q[self._place + 1]], (2, -1))
        if time == 0.0:
            self._start = self._last = place
        self._last, self._end = np.where(going, place, self._last), np.where(going, time, self._end)
        for name, actuators in self._actuators.items():
            used = np.abs(np.reshape(power[actuators], (len(actuators), -1))).sum(axis=0)
            self._work[name] += np.where(going, used * self._dt, 0.0)

    def figures(self, world: int) -> Figures:
        """Return the figures of a world; energy a step is None without a step."""
        steps = float((self._lands + STOOD_S <= self._end[world]).sum())
        way = float(np.hypot(*(self._last - self._start)[:, world]))
        each = {f"{name}_energy_j": float(work[world]) / steps if steps else None for name, work in self._work.items()}
        return {"steps": steps, "distance_m": way, **each}


def walk_series(walk: Walk, plant: Plant) -> Callable[[Axis, Trajectory], dict[str, np.ndarray]]:
    """Make the plan's lines of a recording.

    Returns:
        Function of an axis and a trajectory: places across the axis [m] and shares of the weight, (n_ticks,) each.
    """
    name = plant.filed.model.joint(_free_joint(plant)).name
    loads = walk.plan.load(walk.time)

    def series(axis: Axis, trajectory: Trajectory) -> dict[str, np.ndarray]:
        time, across = trajectory["time_s"], np.cross(axis.direction, axis.up)[:2]
        start = plant.filed.model.key_qpos[plant.key][:2] @ across
        true = np.stack([trajectory[f"position/{name}/{i}_m"] for i in "xy"], axis=-1) @ across - start
        places = {"torso planned": walk.qpos[:, :2] @ across - start}
        places |= {f"{side} foot planned": feet[:, :2] @ across for side, feet in zip(SIDES, walk.feet, strict=True)}
        lines = {f"place/{what}": values for what, values in places.items()}
        lines |= {f"support/{side}": load for side, load in zip(SIDES, loads, strict=True)}
        return {"place/torso": true} | {what: np.interp(time, walk.time, values) for what, values in lines.items()}

    return series


def _free_joint(plant: Plant) -> int:
    return int(np.flatnonzero(plant.filed.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0])
