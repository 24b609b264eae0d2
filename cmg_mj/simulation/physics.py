"""Physics on its own: one world on floats, or many on arrays."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from cmg_mj.elementwise import Scalar
from cmg_mj.plant.plant import Plant

State = tuple[Any, Any]
"""Joint angles, joint rates: lists of floats, or arrays (n, n_worlds)."""


class OneWorld:
    """One world on floats."""

    def __init__(self, plant: Plant) -> None:
        self.model = plant.model
        self.data = plant.new_data()
        self._qpos, self._qvel, self._sensordata = self.data.qpos, self.data.qvel, self.data.sensordata
        self._ctrl, self._applied = self.data.ctrl, self.data.qfrc_applied
        self._forward = partial(mujoco.mj_forward, self.model, self.data)
        self._step = partial(mujoco.mj_step, self.model, self.data)
        self._servos = [list(zip(axis.servos, axis.directions, strict=True)) for axis in plant.axes]
        self._pushes = [list(zip(*axis.line.push, strict=True)) for axis in plant.axes]

    def state(self) -> State:
        """Joint angles and rates as floats."""
        return self._qpos.tolist(), self._qvel.tolist()

    def sense(self) -> Any:
        """MuJoCo's sensordata at the present state, with the torque and the commands that hold there."""
        self._forward()
        return self._sensordata.tolist()

    def command(self, u: Scalar, axis: int = 0) -> None:
        """Set the gimbal rate of an axis, each cube in its direction."""
        ctrl = self._ctrl
        for servo, direction in self._servos[axis]:
            ctrl[servo] = direction * u

    def push(self, *torques: float) -> None:
        """Set the torques about the axes; lines of one free body share its joint."""
        applied = self._applied
        for pushed in self._pushes:
            for dof, _ in pushed:
                applied[dof] = 0.0
        for pushed, torque in zip(self._pushes, torques, strict=True):
            for dof, share in pushed:
                applied[dof] += share * torque

    def advance(self, steps: int) -> None:
        """Take physics steps."""
        self._step(steps)


class ManyWorlds:
    """Many worlds on arrays, stepped by MuJoCo's own thread pool.

    Args:
        plants: The rig of each world.
        threads: Of the pool, on which nothing depends but how long it takes; 0: all processors.

    Attributes:
        running: Which worlds are still stepped, (n_worlds,).
    """

    def __init__(self, plants: Sequence[Plant], threads: int = 0) -> None:
        first = plants[0]
        self.batch = Batch(first.model, len(plants), threads)
        if any(plant is not first for plant in plants):
            self.batch.set_models([plant.model for plant in plants])
        b = self.batch
        self._qpos, self._qvel, self._ctrl = b.bind("qpos"), b.bind("qvel"), b.bind("ctrl")
        self._applied, self._sensordata = b.bind("qfrc_applied"), b.bind("sensordata")
        act = b.bind("act")
        of: dict[Plant, list[int]] = {}
        for i, plant in enumerate(plants):
            of.setdefault(plant, []).append(i)
        for plant, places in of.items():  # one MjData at a time: each takes 13.6 MB
            data = plant.new_data()
            self._qpos[places], self._qvel[places] = data.qpos, data.qvel
            self._ctrl[places], act[places] = data.ctrl, data.act
        self._servos = [axis.servos for axis in first.axes]
        self._directions = [np.array(axis.directions) for axis in first.axes]
        self._pushes = [axis.line.push for axis in first.axes]
        self.running = np.ones(len(plants), dtype=bool)
        self._all_run = True

    def state(self) -> State:
        """Joint angles and rates, each (n, n_worlds)."""
        return self._qpos.T.copy(), self._qvel.T.copy()

    def sense(self) -> Any:
        """MuJoCo's sensordata at the present state, with the torque and the commands that hold there, (n, n_worlds)."""
        try:
            self.batch.forward(None if self._all_run else self.running)
        except SimulationError as error:
            self._qpos[error.ids] = np.nan
        return self._sensordata.T.copy()

    def command(self, u: Scalar, axis: int = 0) -> None:
        """Set the gimbal rates of an axis, each cube in its direction."""
        self._ctrl[:, self._servos[axis]] = np.multiply.outer(u, self._directions[axis])

    def push(self, *torques: Scalar) -> None:
        """Set the torques about the axes, one for all or (n_worlds,) each; lines of one free body share its joint."""
        for dofs, _ in self._pushes:
            self._applied[:, dofs] = 0.0
        for (dofs, shares), torque in zip(self._pushes, torques, strict=True):
            self._applied[:, dofs] += np.multiply.outer(torque, shares)

    def stop(self, worlds: np.ndarray) -> None:
        """Step these worlds no more."""
        self.running &= ~worlds
        self._all_run = False

    def advance(self, steps: int) -> None:
        """Take physics steps. A world in which MuJoCo raises is given joints that are NaN: it has diverged."""
        try:
            self.batch.step(None if self._all_run else self.running, nstep=steps)
        except SimulationError as error:
            self._qpos[error.ids] = np.nan
