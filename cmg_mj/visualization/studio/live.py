"""Runs a scenario's plant and controller in another loop, such as Studio's, changed and pushed during the run."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.axes import AnyController
from cmg_mj.errors import InputError, RunStopped
from cmg_mj.plant.moving_pivot import pivot_directions
from cmg_mj.plant.mujoco_state import set_control_callback
from cmg_mj.plant.tilt_line import apply_torques
from cmg_mj.scenario.pivot_signals import PivotSignals
from cmg_mj.simulation.callback import control
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.visualization.studio.drawn_plant import copy_physics_numbers, drawn_plant
from cmg_mj.visualization.studio.history import ControllerHistory, continued
from cmg_mj.visualization.studio.settings import FieldValues, changed_fields
from cmg_mj.visualization.studio.user_push import Pushes

PLOTTED_TICKS = 2400
"""Number of plotted ticks: 12 s at 200 Hz."""


class PlottedTick(NamedTuple):
    """A control tick of one axis in the plots: x1, the true and the estimated rate, u, the push."""

    time_s: float
    tilt_deg: float
    rate_rad_s: float
    estimate_rad_s: float
    command_rad_s: float
    push_n_m: float


class StudioSession:
    """A scenario that the owner of its data steps. Without interference its trajectory is the runner's.

    Args:
        experiment: The scenario.

    Attributes:
        base: The scenario at the start.
        now: The scenario with the user's changes.
        plant: The plant, on a model that has visual geoms as well.
        pushes: The torques from outside.
        stopped: The reason why the controller has stopped and the gimbals stand; empty while it runs.
        diverged: Whether the controller has stopped because the physics diverged.
        note: Result of the last change or jump, if the user should know.
        ticks: The last ticks of each axis, for the plots.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.base = self.now = experiment
        self.plant = drawn_plant(experiment.plant)
        self.note = ""
        self.timestep = self.plant.timestep
        self._lines = [axis.line for axis in self.plant.axes]
        scenario = experiment.scenario
        self.pushes = Pushes(scenario.push, scenario.swing, self.plant.axis_names, self.timestep)
        self._pivot = PivotSignals(scenario.pivot, pivot_directions(self.plant, scenario.pivot), scenario.seed, 0)
        self._still = self.model.opt.gravity.copy()
        self._pivot_steps: tuple[int, int] | None = None if scenario.pivot else (0, sys.maxsize)
        """The steps between which the present acceleration of the pivot is held; for ever if it is at rest."""
        self.ticks: deque[tuple[PlottedTick, ...]] = deque(maxlen=PLOTTED_TICKS)
        self._begin(0)

    @property
    def model(self) -> mujoco.MjModel:
        """The model that is stepped and shown."""
        return self.plant.model

    # --- time ----------------------------------------------------------------------------------------------

    def new_data(self) -> mujoco.MjData:
        """Make data at the scenario's initial state, and begin the run there."""
        data = mujoco.MjData(self.model)
        self.start(data)
        return data

    def start(self, data: mujoco.MjData) -> None:
        """Put the plant at the scenario's initial state, and begin the run; the user's changes stay."""
        initial = self.now.plant.new_data()
        everything = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_copyState(self.now.plant.model, initial, data, everything)
        with set_control_callback(None):
            mujoco.mj_forward(self.model, data)
        self.begin(data)

    def begin(self, data: mujoco.MjData) -> None:
        """Begin a run at the present state, with a fresh controller."""
        step = self._step_of(data)
        self.pushes.forget(step)
        self.note = ""
        self.ticks.clear()
        self._begin(step)

    def _begin(self, step: int) -> None:
        self.controller: AnyController = self.now.controller()
        self.history = ControllerHistory(self.now, step)
        self.stopped = ""
        self.diverged = False
        self._stopped_at = 0
        self._next = step
        """The next step, unless someone moves the state in time."""

    def _step_of(self, data: mujoco.MjData) -> int:
        return round(data.time / self.timestep)

    def step(self, data: mujoco.MjData) -> bool:
        """Advance one physics step, before which the controller takes due samples and decisions.

        No failure of an observer or of the physics raises from here.

        Args:
            data: The plant's data.

        Returns:
            Whether there was a control tick.
        """
        step = self.sync_to_time(data)
        torques = self.pushes.at(step, self.controller.steps_per_sample)
        # Studio's mouse writes xfrc_applied: MuJoCo adds them up.
        apply_torques(data.qfrc_applied, self._lines, torques)
        self._accelerate(step)
        ticked = not self.stopped and self._control(data, step, torques)
        mujoco.mj_step(self.model, data)
        self._next = step + 1
        if not np.isfinite(data.qpos).all():
            self.diverged = True
            self._stop(data, step, f"the physics diverged at t = {data.time:g} s; reset")
        return ticked

    def _accelerate(self, step: int) -> None:
        """Set the pivot's acceleration during a physics step, which is held as long as a swinging torque."""
        if self._pivot_steps is not None and self._pivot_steps[0] <= step < self._pivot_steps[1]:
            return
        self._pivot_steps = self.pushes.interval(step, self.controller.steps_per_sample)
        start, end = self._pivot_steps
        self.model.opt.gravity[:] = self._still - self._pivot.mean(start * self.timestep, end * self.timestep)

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
            self.history.add_sample(step, data)
        if ticked:
            axes = range(len(torques))
            self.ticks.append(tuple(self._plotted_tick(data, axis, torques[axis]) for axis in axes))
        return ticked

    def _plotted_tick(self, data: mujoco.MjData, axis: int, torque: float) -> PlottedTick:
        """Return the last tick of an axis."""
        line, tick = self.plant.axes[axis].line, self.controller.parts[axis].tick
        assert tick is not None
        x1 = math.degrees(float(line.lean(data.qpos)) + self.now.plant.axes[axis].bias)
        return PlottedTick(data.time, x1, float(line.rate(data.qvel)), tick.estimates[0][1], tick.u, torque)

    def _stop(self, data: mujoco.MjData, step: int, why: str) -> None:
        self.stopped, self._stopped_at = why, step
        for axis in self.plant.axes:
            data.ctrl[axis.servos] = 0.0

    def sync_to_time(self, data: mujoco.MjData) -> int:
        """Restore the controller of the state's time, if someone has moved the state; return the step.

        Studio's history has states only. Controller, settings and the user's pushes become those of that time.
        """
        step = self._step_of(data)
        if step == self._next:
            return step
        self._next = step
        self.ticks = deque((tick for tick in self.ticks if tick[0].time_s < data.time - 1e-9), PLOTTED_TICKS)
        if self.stopped and step > self._stopped_at:
            return step  # it does not control at that moment either
        self.pushes.forget(step)
        if self.history.has(step):
            try:
                self.controller, was = self.history.back_to(step)
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
        """Return the scenario and the reason of a stop at the state's time, and change nothing."""
        step = self._step_of(data)
        if step == self._next:
            return self.now, self.stopped
        stopped = self.stopped if step > self._stopped_at else ""
        return self.history.experiment_at(step) if self.history.has(step) else self.now, stopped

    # --- what a user changes -------------------------------------------------------------------------------

    def choose(self, data: mujoco.MjData, values: FieldValues) -> None:
        """Change settings of the scenario on all axes; `note` has the reason of a refusal.

        A new observer starts from the next sample. A stopped controller starts afresh.

        Args:
            data: The plant's data.
            values: Field, named as with `--set` -> value: the observer, the law, `controller.feedback`, the
                accelerometers' noise, e.
        """
        step = self.sync_to_time(data)
        try:
            fields = changed_fields(self.base, self.now, values)
            if self.now.scenario.plant.timestep_s is None:
                fields["plant.timestep_s"] = self.timestep  # the one it runs with
            new = self.now.with_settings(fields)
        except InputError as error:
            self.note = str(error)
            return
        source = self.base.scenario.source  # which would grow with every change
        new = dataclasses.replace(new, scenario=new.scenario.with_source(source))
        self.note = "; ".join(new.hints)
        self._apply_settings(new)
        if self.stopped:
            self.restart_controller(data)
            return
        self.controller = continued(self.now, self.controller)
        if self.history.whole:
            self.history.add_change(self.now, afresh=False)
        assert step == self._next

    def _apply_settings(self, experiment: Experiment) -> None:
        """Continue with an experiment; the model changes in place, because others hold it too."""
        before, after = ([part.scenario.plant for part in parts] for parts in (self.now.parts, experiment.parts))
        if after != before:
            copy_physics_numbers(self.model, experiment.plant.model)
        self.now = experiment

    def restart_controller(self, data: mujoco.MjData) -> None:
        """Start the controller afresh at the present state, for instance after the failure of an observer."""
        step = self.sync_to_time(data)
        self.stopped = self.note = ""
        self.controller = self.now.controller()
        if self.history.whole:
            self.history.add_change(self.now, afresh=True)
        else:
            self.history = ControllerHistory(self.now, step)

    def push(self, data: mujoco.MjData, torque: float, duration_s: float, axis: int = 0) -> None:
        """Push from now on: torque about a tilt axis by its index [N m], duration [s]."""
        self.pushes.add(self.sync_to_time(data), torque, duration_s, axis)
