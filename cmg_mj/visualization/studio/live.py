"""A scenario's rig and controller in somebody else's loop, changed and pushed while they run; without Studio."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from cmg_mj.controllers.make_controller import AnyController
from cmg_mj.errors import InputError, RunStopped
from cmg_mj.plant.mujoco_state import set_control_callback
from cmg_mj.plant.tilt_line import apply_torques
from cmg_mj.simulation.callback import control
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.visualization.studio.drawn_plant import copy_physics_numbers, drawn_plant
from cmg_mj.visualization.studio.history import ControllerHistory, adopt
from cmg_mj.visualization.studio.settings import fields_of
from cmg_mj.visualization.studio.user_push import Pushes

KEPT_TICKS = 2400
"""Of what is plotted: 12 s at 200 Hz."""


class PlottedTick(NamedTuple):
    """A control tick as it is plotted, of one axis: x1, its true and its estimated rate, u."""

    time_s: float
    tilt_deg: float
    rate_rad_s: float
    estimate_rad_s: float
    command_rad_s: float
    push_n_m: float


class StudioSession:
    """A scenario that is stepped by whoever owns its data. As long as nobody interferes, it is the runner's trajectory.

    Args:
        experiment: The scenario.

    Attributes:
        base: The scenario as it was opened.
        now: The scenario as it has been changed since.
        plant: Its rig, on a model that has what is only seen as well.
        pushes: The torques from outside.
        stopped: Why the controller no longer controls; empty while it does. The gimbals then stand.
        diverged: Whether that is because the physics has no numbers any more.
        note: What the last change or jump came to, if it is worth a line.
        ticks: The last ones, to be plotted: of each axis.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.base = self.now = experiment
        self.plant = drawn_plant(experiment.plant)
        self.note = ""
        self.timestep = self.plant.timestep
        self._lines = [axis.line for axis in self.plant.axes]
        scenario = experiment.scenario
        self.pushes = Pushes(scenario.push, scenario.swing, self.plant.axis_names, self.timestep)
        self.ticks: deque[tuple[PlottedTick, ...]] = deque(maxlen=KEPT_TICKS)
        self._begin(0)

    @property
    def model(self) -> mujoco.MjModel:
        """What is stepped and seen."""
        return self.plant.model

    # --- time ----------------------------------------------------------------------------------------------

    def new_data(self) -> mujoco.MjData:
        """Data at the scenario's initial state, from which the run begins."""
        data = mujoco.MjData(self.model)
        self.start(data)
        return data

    def start(self, data: mujoco.MjData) -> None:
        """Put the rig at the scenario's initial state, wheels at speed, and begin the run; what was changed stays."""
        initial = self.now.plant.new_data()
        everything = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_copyState(self.now.plant.model, initial, data, everything)
        with set_control_callback(None):
            mujoco.mj_forward(self.model, data)
        self.begin(data)

    def begin(self, data: mujoco.MjData) -> None:
        """Begin a run at the state in which the rig is, with a fresh controller."""
        step = self._step_of(data)
        self.pushes.forget(step)
        self.note = ""
        self.ticks.clear()
        self._begin(step)

    def _begin(self, step: int) -> None:
        self.controller: AnyController = self.now.controller()
        self.memory = ControllerHistory(self.now, step)
        self.stopped = ""
        self.diverged = False
        self._stopped_at = 0
        self._next = step
        """The step that comes next, unless somebody else has a hand in it."""

    def _step_of(self, data: mujoco.MjData) -> int:
        return round(data.time / self.timestep)

    def step(self, data: mujoco.MjData) -> bool:
        """One physics step, before which the controller takes the samples and the decision that are due.

        Nothing of what an observer or the physics does raises from here.

        Args:
            data: The rig's.

        Returns:
            Whether there was a control tick.
        """
        step = self.sync_to_time(data)
        torques = self.pushes.at(step, self.controller.steps_per_sample)
        # Studio's mouse writes xfrc_applied: MuJoCo adds them up.
        apply_torques(data.qfrc_applied, self._lines, torques)
        ticked = not self.stopped and self._control(data, step, torques)
        mujoco.mj_step(self.model, data)
        self._next = step + 1
        if not np.isfinite(data.qpos).all():
            self.diverged = True
            self._stop(data, step, f"the physics diverged at t = {data.time:g} s; reset")
        return ticked

    def _control(self, data: mujoco.MjData, step: int, torques: Sequence[float]) -> bool:
        lean = self.plant.largest_tilt(data.qpos)
        if not abs(lean) <= math.radians(self.now.scenario.metrics.fall_angle_deg):
            self._stop(data, step, f"the rig fell at t = {data.time:g} s; reset, or go back in time")
            return False
        try:
            ticked = control(self.plant, self.controller, data)
        except (InputError, RunStopped) as error:
            self._stop(data, step, str(error))
            return False
        if step % self.controller.steps_per_sample == 0:
            self.memory.show(step, data)
        if ticked:
            axes = range(len(torques))
            self.ticks.append(tuple(self._shown(data, axis, torques[axis]) for axis in axes))
        return ticked

    def _shown(self, data: mujoco.MjData, axis: int, torque: float) -> PlottedTick:
        """The last tick of an axis."""
        line, tick = self.plant.axes[axis].line, self.controller.parts[axis].tick
        assert tick is not None
        x1 = math.degrees(float(line.lean(data.qpos)) + self.now.plant.axes[axis].bias)
        return PlottedTick(data.time, x1, float(line.rate(data.qvel)), tick.estimates[0][1], tick.u, torque)

    def _stop(self, data: mujoco.MjData, step: int, why: str) -> None:
        self.stopped, self._stopped_at = why, step
        for axis in self.plant.axes:
            data.ctrl[axis.servos] = 0.0

    def sync_to_time(self, data: mujoco.MjData) -> int:
        """Bring the controller to where the state is, should somebody have moved it in time; the step it is at.

        History holds states only. The controller, all that was changed, and the pushes by hand become what they were.
        """
        step = self._step_of(data)
        if step == self._next:
            return step
        self._next = step
        self.ticks = deque((tick for tick in self.ticks if tick[0].time_s < data.time - 1e-9), KEPT_TICKS)
        if self.stopped and step > self._stopped_at:
            return step  # it does not control at that moment either
        self.pushes.forget(step)
        if self.memory.has(step):
            try:
                self.controller, was = self.memory.back_to(step)
                self._apply_settings(was)
                self.stopped, self.note, self.diverged = "", "", False
                return step
            except (InputError, RunStopped) as error:
                self.note = f"the controller could not be brought back ({error}) and starts afresh"
        else:
            self.note = f"nothing is remembered of t = {data.time:g} s: the controller starts afresh"
        self._begin(step)
        return step

    def settings_at(self, data: mujoco.MjData) -> tuple[Experiment, str]:
        """The scenario, and why the controller does not control, as they were where the state is; looked at only."""
        step = self._step_of(data)
        if step == self._next:
            return self.now, self.stopped
        stopped = self.stopped if step > self._stopped_at else ""
        return self.memory.told(step) if self.memory.has(step) else self.now, stopped

    # --- what a user changes -------------------------------------------------------------------------------

    def choose(self, data: mujoco.MjData, values: Mapping[str, Any]) -> None:
        """Change settings of the scenario while it runs, on all axes; `note` says what was refused.

        A new observer starts from the next sample. A controller that was stopped starts afresh.

        Args:
            data: The rig's.
            values: By field, named as with `--set`: the observer, the law, `controller.feedback`, the accelerometers'
                noise, e.
        """
        step = self.sync_to_time(data)
        try:
            fields = fields_of(self.base, self.now, values)
            if self.now.scenario.plant.timestep_s is None:
                fields["plant.timestep_s"] = self.timestep  # the one it runs with
            new = self.now.with_settings(fields)
            if not self.stopped:
                adopt(self.controller, self.now, new)
        except InputError as error:
            self.note = str(error)
            return
        new.scenario._source = self.base.scenario._source  # which would grow with every change
        self.note = "; ".join(new.hints)
        self._apply_settings(new)
        if self.stopped:
            self.restart_controller(data)
        elif self.memory.whole:
            self.memory.tell(new, afresh=False)
        assert step == self._next

    def _apply_settings(self, experiment: Experiment) -> None:
        """Go on as this experiment's; the rig changes in place, so that whoever holds its model goes on too."""
        before, after = ([own.scenario.plant for own in each.parts] for each in (self.now, experiment))
        if after != before:
            copy_physics_numbers(self.model, experiment.plant.model)
        self.now = experiment

    def restart_controller(self, data: mujoco.MjData) -> None:
        """Start the controller afresh at the present state, as after an observer that failed."""
        step = self.sync_to_time(data)
        self.stopped = self.note = ""
        self.controller = self.now.controller()
        if self.memory.whole:
            self.memory.tell(self.now, afresh=True)
        else:
            self.memory = ControllerHistory(self.now, step)

    def push(self, data: mujoco.MjData, torque: float, duration_s: float, axis: int = 0) -> None:
        """Push from now on: torque [N m] about a tilt axis, given by its place, for so long [s]."""
        self.pushes.add(self.sync_to_time(data), torque, duration_s, axis)
