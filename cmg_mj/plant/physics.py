"""Steps the physics of a plant: one world on floats, or many on arrays."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axis import Tick
from cmg_mj.core.loop import Acceleration, Joints, State
from cmg_mj.core.rig import Readings
from cmg_mj.plant.plant import Plant
from cmg_mj.plant.tilt_line import apply_torques


class OneWorld:
    """Steps one world on floats."""

    any_running = True
    running = None
    stop_failed = None

    def __init__(self, plant: Plant, data: mujoco.MjData | None = None) -> None:
        self._plant = plant
        self.model = plant.model
        self.data = plant.new_data() if data is None else data
        self._qpos, self._qvel, self._sensordata = self.data.qpos, self.data.qvel, self.data.sensordata
        self._ctrl, self._applied = self.data.ctrl, self.data.qfrc_applied
        self._forward = partial(mujoco.mj_forward, self.model, self.data)
        self.advance = partial(mujoco.mj_step, self.model, self.data)  # no method: a call less in every tick
        self._still: list[float] = self.model.opt.gravity.tolist()
        self._servos = [list(zip(axis.servos, axis.directions, strict=True)) for axis in plant.axes]
        self._lines = [axis.line for axis in plant.axes]
        self.axis_names = plant.axis_names
        self.tilt, self._ideal = plant.largest_tilt, plant.ideal_readings

    def __reduce__(self) -> tuple:
        """Copy and pickle plant and data, which all else looks into, and what has changed since."""
        changed = {"any_running": self.any_running, "_still": self._still}
        return OneWorld, (self._plant, self.data), changed

    def state(self) -> State:
        """Read joint angles and rates as floats."""
        return self._qpos.tolist(), self._qvel.tolist()

    def reading(self, v: Joints) -> Readings:
        """Compute what perfect sensors show at the present state, with the torques and commands that hold there."""
        self._forward()
        return self._ideal(self._sensordata.tolist(), v)

    def command(self, u: Scalar, axis: int = 0) -> None:
        """Set the gimbal rate of an axis, each module in its direction [rad/s]."""
        ctrl = self._ctrl
        for servo, direction in self._servos[axis]:
            ctrl[servo] = direction * u

    def control(self, actuators: Sequence[int], setpoints: Any) -> None:
        """Set the controls of other actuators."""
        self._ctrl[actuators] = setpoints

    def power(self) -> np.ndarray:
        """Return the power of each actuator at the last physics step, (n,) [W]."""
        return self.data.actuator_force * self.data.actuator_velocity

    def push(self, torques: Sequence[Scalar]) -> Sequence[Scalar]:
        """Set the torques about the axes [N m]."""
        apply_torques(self._applied, self._lines, torques)
        return torques

    def accelerate(self, acceleration: Acceleration) -> None:
        """Set the pivot's acceleration, x, y, z [m/s^2]: gravity of the plant's model, which is its own."""
        x, y, z = acceleration
        gx, gy, gz = self._still
        self.model.opt.gravity[:] = gx - x, gy - y, gz - z

    def stop_fallen(self, tilt: Scalar, limit: float) -> Sequence[tuple[int, float]]:
        """Stop the world if its tilt is beyond a limit, or no number."""
        if abs(tilt) <= limit:
            return ()
        self.any_running = False
        return ((0, tilt),)


class ManyWorlds:
    """Steps many worlds on arrays, with MuJoCo's own thread pool.

    Args:
        plants: The plant of each world.
        threads: Of the pool, on which nothing depends but how long it takes; 0: all processors.

    Attributes:
        running: Which worlds are still stepped, (n_worlds,).
    """

    def __init__(self, plants: Sequence[Plant], threads: int = 0) -> None:
        first = plants[0]
        self.batch = Batch(first.model, len(plants), threads)
        if any(plant is not first for plant in plants):
            self.batch.set_models([plant.model for plant in plants])
        self._plants = plants
        self._gravity = self._still = np.zeros((0, 3))
        self._own_models: list[mujoco.MjModel] = []
        b = self.batch
        self._qpos, self._qvel, self._ctrl = b.bind("qpos"), b.bind("qvel"), b.bind("ctrl")
        self._applied, self._sensordata = b.bind("qfrc_applied"), b.bind("sensordata")
        act = b.bind("act")
        worlds_of: dict[Plant, list[int]] = {}
        for i, plant in enumerate(plants):
            worlds_of.setdefault(plant, []).append(i)
        for plant, places in worlds_of.items():  # one MjData at a time: each takes 13.6 MB
            data = plant.new_data()
            self._qpos[places], self._qvel[places] = data.qpos, data.qvel
            self._ctrl[places], act[places] = data.ctrl, data.act
        self._servos = [axis.servos for axis in first.axes]
        self._directions = [np.array(axis.directions) for axis in first.axes]
        self._lines = [axis.line for axis in first.axes]
        self.tilt, self._ideal = first.largest_tilt, first.ideal_readings
        self.running: np.ndarray = np.ones(len(plants), dtype=bool)
        self.any_running = self._all_running = True

    def state(self) -> State:
        """Copy joint angles and rates, each (n, n_worlds)."""
        return self._qpos.T.copy(), self._qvel.T.copy()

    def reading(self, v: Joints) -> Readings:
        """Compute what perfect sensors show at the present state, with the torques and commands that hold there."""
        try:
            self.batch.forward(None if self._all_running else self.running)
        except SimulationError as error:
            self._qpos[error.ids] = np.nan
        return self._ideal(self._sensordata.T.copy(), v)

    def command(self, u: Scalar, axis: int = 0) -> None:
        """Set the gimbal rates of an axis, each module in its direction [rad/s]."""
        self._ctrl[:, self._servos[axis]] = np.multiply.outer(u, self._directions[axis])

    def control(self, actuators: Sequence[int], setpoints: Any) -> None:
        """Set the controls of other actuators, one for all worlds or (n, n_worlds)."""
        self._ctrl[:, actuators] = np.transpose(setpoints)

    def power(self) -> np.ndarray:
        """Return the power of each actuator at the last physics step, (n, n_worlds) [W]."""
        return (self.batch.bind("actuator_force") * self.batch.bind("actuator_velocity")).T

    def push(self, torques: Sequence[Scalar]) -> Sequence[Scalar]:
        """Set the torques about the axes, one for all or (n_worlds,) each; return arrays (n_worlds,) [N m]."""
        apply_torques(self._applied.T, self._lines, torques)
        return [np.broadcast_to(torque, len(self.running)) for torque in torques]

    def accelerate(self, acceleration: Acceleration) -> None:
        """Set the pivot's acceleration, x, y, z, one for all or (n_worlds,) each [m/s^2]."""
        if not len(self._still):
            if self.batch.models is None:
                self._gravity = self.batch.expand("opt.gravity")
            else:
                self._own_models = [copy.copy(plant.model) for plant in self._plants]
                self._gravity = np.array([model.opt.gravity for model in self._own_models])
            self._still = self._gravity.copy()
        for i, part in enumerate(acceleration):
            self._gravity[:, i] = self._still[:, i] - part
        if self._own_models:
            for model, gravity in zip(self._own_models, self._gravity, strict=True):
                model.opt.gravity[:] = gravity
            self.batch.set_models(self._own_models)

    def advance(self, steps: int) -> None:
        """Take physics steps. A world in which MuJoCo raises is given joints that are NaN: it has diverged."""
        try:
            self.batch.step(None if self._all_running else self.running, nstep=steps)
        except SimulationError as error:
            self._qpos[error.ids] = np.nan

    def stop_fallen(self, tilt: Scalar, limit: float) -> Sequence[tuple[int, float]]:
        """Stop the worlds whose tilt is beyond a limit, or no number; return each one's index and tilt [rad]."""
        return [(int(i), float(tilt[i])) for i in self._stop(~(np.abs(tilt) <= limit))]

    def stop_failed(self, tick: Tick) -> Sequence[tuple[int, str]]:
        """Stop the worlds whose observer or law returned a non-finite value; return each one's index and why."""
        returned = {"observer returned an estimate": sum(tick.estimates[0]), "law returned a command": tick.u}
        return [
            (int(i), f"the {what} that is not finite")
            for what, numbers in returned.items()
            for i in self._stop(~np.isfinite(numbers))
        ]

    def _stop(self, worlds: np.ndarray) -> np.ndarray:
        """Step these worlds no more; return the indices of those that were running."""
        stopped = worlds & self.running
        if not stopped.any():
            return np.array([], dtype=int)
        self.running &= ~stopped
        self._all_running = False
        self.any_running = bool(self.running.any())
        return np.flatnonzero(stopped)
