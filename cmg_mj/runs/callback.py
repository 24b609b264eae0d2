"""The Controller in a user's own loop, and as MuJoCo's control callback."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.loop import ControlLoop
from cmg_mj.plant.mjcf import set_control_callback
from cmg_mj.plant.plant import Plant


def control(plant: Plant, controller: Controller, data: mujoco.MjData) -> bool:
    """Sample what is due at this physics step, and set the servos' commands if it is a control tick.

    Call it before every `mujoco.mj_step`, after the torques from outside have been set. Where something is due it runs
    `mj_forward`, so that every sensor shows the present state.

    Args:
        plant: The rig.
        controller: Its controller.
        data: The simulation.

    Returns:
        Whether a control tick was due.

    Raises:
        InputError: The caller skipped steps at which something was due.
        RunStopped: The plant diverged, or an observer failed.
    """
    with set_control_callback(None):  # the forward pass is a look at the sensors, no step
        return _tick(plant, controller, data, lambda: _forward(plant.model, data))


def _forward(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    mujoco.mj_forward(model, data)
    return data.sensordata


def _tick(plant: Plant, controller: Controller, data: mujoco.MjData, sense: Callable[[], np.ndarray]) -> bool:
    """Sample what is due, from sensordata as `sense` gives it, and set the servos if it is a control tick."""
    step = round(data.time / plant.model.opt.timestep)
    if step % controller.steps_per_sample:
        return False
    if controller.step is not None:
        if step < controller.step:  # the simulation was reset
            controller.reset()
        elif step > controller.step + controller.steps_per_sample:
            raise InputError(
                f"control() was last called at step {controller.step} and now at step {step}: call it at least every "
                f"{controller.steps_per_sample} physics steps, before the step"
            )
    if not math.isfinite(plant.largest_tilt(data.qpos)):
        raise RunStopped(f"the plant diverged at t = {data.time:g} s")
    if not controller.update(step, plant.ideal_readings(sense().tolist(), data.qvel.tolist())):
        return False
    _hold(plant, controller, data)
    return True


def _hold(plant: Plant, controller: Controller, data: mujoco.MjData) -> None:
    """Set the servos' commands to those of the last tick."""
    for axis, rate in zip(plant.axes, controller.gimbal_rates, strict=False):  # before the first tick there are none
        for module in axis.modules:
            data.ctrl[module.servo] = module.direction * rate
    if controller.moves_others and controller.tick is not None:
        actuators, controls = controller.setpoints
        data.ctrl[actuators] = controls


class ControlCallback:
    """Callable as `mjcb_control`: advances the controller exactly once a control period.

    MuJoCo calls back once a step, in RK4 four times: at t, twice at t + h/2, and at t + h, the last one bearing the
    same time as the first of the next step. Only the first call of a step is a sampling instant. Calls from
    `mj_forward` repeat an instant and change nothing. If time runs backwards (a reset), the controller starts afresh.

    Every call sets all controls, the flywheels' nominal speeds too, because others (`mujoco.rollout`, a viewer) write
    theirs between the calls.

    Args:
        plant: The rig.
        controller: Its controller.
    """

    def __init__(self, plant: Plant, controller: Controller) -> None:
        self.plant = plant
        self.controller = controller
        self._scratch = mujoco.MjData(plant.model)
        self._instant: float | None = None
        self._latest = -math.inf
        self._half_stages = 0

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Take the control decision if this call is the first at a sampling instant."""
        _hold(self.plant, self.controller, data)
        for axis in self.plant.axes:
            for module in axis.modules:
                data.ctrl[module.motor] = module.speed
        if self._is_instant(model.opt.timestep, data.time):
            _tick(self.plant, self.controller, data, lambda: self._sense(data))

    def _sense(self, data: mujoco.MjData) -> np.ndarray:
        """Sensordata at the present state and commands, by a pass of its own: MuJoCo is in the middle of one."""
        model = self.plant.model
        mujoco.mj_copyState(model, data, self._scratch, int(mujoco.mjtState.mjSTATE_INTEGRATION))
        with set_control_callback(None):
            return _forward(model, self._scratch)

    def _is_instant(self, h: float, t: float) -> bool:
        """Return whether a call at time t is the first of a step of length h, not one of its later stages."""
        backwards = t < self._latest
        self._latest = t
        if self._instant is not None and not backwards:
            ahead = (t - self._instant) / h
            if ahead < 0.25:  # a repeated forward pass at this instant
                self._half_stages = 0
                return False
            if ahead < 0.75:  # RK4's second and third stage
                self._half_stages += 1
                return False
            if self._half_stages >= 2 and ahead < 1.25:  # RK4's fourth stage, before the next step's first
                self._half_stages = 0
                return False
        if backwards and (self.controller.step or 0) >= round(t / h):  # else its state has been put back too
            self.controller.reset()
        self._half_stages = 0
        self._instant = t
        return True


class CallbackLoop(ControlLoop):
    """The loop of a run in which MuJoCo calls the controller, while `control_callback` is in force."""

    takes_samples = False

    def decide(self) -> None:
        """Leave the decision to the callback, which takes it at the first of the next physics steps."""


@contextmanager
def control_callback(plant: Plant, controller: Controller) -> Iterator[ControlCallback]:
    """Install the controller as MuJoCo's control callback, and take it out again even on an exception.

    `mjcb_control` is one pointer for the whole process: while it is installed, only this plant may be stepped.
    What was installed before comes back.

    Args:
        plant: The rig.
        controller: A fresh controller for it.

    Yields:
        The callback.
    """
    callback = ControlCallback(plant, controller)
    with set_control_callback(callback):
        yield callback
