"""A scenario's plant and controller in another loop, such as Studio's, changed and pushed during the run."""

from __future__ import annotations

import copy
import dataclasses
import math
from bisect import bisect_right
from collections import deque
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.controller import ControllerState
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.loop import acting, next_instant
from cmg_mj.features.studio.settings import FieldValues, changed_fields
from cmg_mj.inputs.messages import LARGEST
from cmg_mj.inputs.types import MAX_TIME_S
from cmg_mj.plant.mjcf import set_control_callback
from cmg_mj.plant.plant import Plant
from cmg_mj.plant.tilt_line import apply_torques
from cmg_mj.runs.callback import control
from cmg_mj.runs.disturbances import disturbances, outsides
from cmg_mj.runs.experiment import Experiment
from cmg_mj.stages.push import Push, Pushes

PLOTTED_TICKS = 2400
"""Number of plotted ticks: 12 s at 200 Hz."""

SAVED = 20_000
"""Number of instants to which the controller can go back: 100 s at 200 Hz."""

PHYSICS_ARRAYS = (
    "actuator_acc0",
    "actuator_biasprm",
    "actuator_gainprm",
    "body_inertia",
    "body_invweight0",
    "body_ipos",
    "body_iquat",
    "body_mass",
    "body_sameframe",
    "body_simple",
    "body_subtreemass",
    "dof_M0",
    "dof_armature",
    "dof_damping",
    "dof_frictionloss",
    "dof_invweight0",
    "dof_length",
    "dof_simplenum",
    "key_ctrl",
    "key_qvel",
    "site_pos",
    "site_quat",
    "site_sameframe",
    "tendon_invweight0",
)
"""Arrays of a model that `plant.settings` changes or `mj_setConst` derives from them; none is indexed by geoms."""

MUJOCO_VIEW = (90.0, -45.0)
STUDIO_VIEW = (125.0, -20.0)
"""Azimuth and elevation of the first view, unless the model file gives another than MuJoCo's default [deg]."""


def drawn_plant(plant: Plant) -> Plant:
    """Copy a plant onto a model of its own that has the visual geoms as well.

    Args:
        plant: The plant.

    Returns:
        A plant whose steps equal those of the first bit for bit.
    """
    other = copy.copy(plant)
    other.model = copy.copy(plant.drawn_model)
    other.model.opt = plant.model.opt
    view = other.model.vis.global_
    if (view.azimuth, view.elevation) == MUJOCO_VIEW:
        view.azimuth, view.elevation = STUDIO_VIEW
    copy_physics_numbers(other.model, plant.model)
    return other


def copy_physics_numbers(model: mujoco.MjModel, reference: mujoco.MjModel) -> None:
    """Make a model with more geoms step as another model of the same plant does.

    Args:
        model: The model to change.
        reference: The plant with its scenario's variations, without visual geoms.
    """
    model.stat.meaninertia = reference.stat.meaninertia  # scales the constraint solver's tolerance
    for name in PHYSICS_ARRAYS:
        getattr(model, name)[:] = getattr(reference, name)


class PlottedTick(NamedTuple):
    """A control tick of one axis in the plots: x1, the true and the estimated rate, u."""

    time_s: float
    tilt_deg: float
    rate_rad_s: float
    estimate_rad_s: float
    command_rad_s: float


class StudioSession:
    """A scenario that others step. Without interference its trajectory is the runner's.

    Args:
        experiment: The scenario.

    Attributes:
        base: The scenario at the start.
        now: The scenario with the user's changes.
        plant: The plant, on a model that has visual geoms as well.
        data: The plant's data, which others may move.
        stopped: The reason why the controller has stopped and the gimbals stand; empty while it runs.
        diverged: Whether the controller has stopped because the physics diverged.
        note: Result of the last change or jump, if the user should know.
        ticks: The last ticks of each axis, for the plots.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.base = self.now = experiment
        self.plant, scenario = drawn_plant(experiment.plant), experiment.scenario
        self.timestep = self.plant.timestep
        self._lines = [axis.line for axis in self.plant.axes]
        self._users_pushes: list[Push] = []
        others = {name: parts for name, parts in outsides(scenario).items() if name != "push"}
        self._others = disturbances(others, [self.plant], scenario.seed, 0)
        for one in self._others:
            (self.plant,) = one.placed([self.plant])
        self._gravity = self.model.opt.gravity.copy()
        self.ticks: deque[tuple[PlottedTick, ...]] = deque(maxlen=PLOTTED_TICKS)
        self._saved: dict[int, ControllerState] = {}
        self.data = mujoco.MjData(self.model)
        self.start()

    @property
    def model(self) -> mujoco.MjModel:
        """The model that is stepped and shown."""
        return self.plant.model

    def start(self) -> None:
        """Put the plant at the scenario's initial state, and begin the run; the user's changes stay."""
        initial = self.now.plant.new_data()
        everything = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_copyState(self.now.plant.model, initial, self.data, everything)
        with set_control_callback(None):
            mujoco.mj_forward(self.model, self.data)
        self.begin()

    def begin(self) -> None:
        """Begin a run at the present state, with a fresh controller."""
        self.ticks.clear()
        self._go_to(round(self.data.time / self.timestep))
        self._start_controller()

    def _go_to(self, step: int) -> None:
        """Take a step for the present one; later pushes and ticks are forgotten."""
        self._next = step
        """The next step, unless someone moves the state in time."""
        self.diverged = False
        self._users_pushes = [push for push in self._users_pushes if push.start_s < (step - 0.5) * self.timestep]
        while self.ticks and self.ticks[-1][0].time_s > self.data.time - 1e-9:
            self.ticks.pop()

    def _start_controller(self) -> None:
        self.controller = self.now.controller()
        self._saved.clear()
        self.note = self.stopped = ""
        self._set_pushes()

    def _set_pushes(self) -> None:
        """Let the scenario's pushes and the user's act."""
        pushes = [*self.base.scenario.push, *self._users_pushes]
        self._disturbances = [Pushes(pushes, self.timestep, self.plant.axis_names), *self._others]
        self._edges = sorted(edge for disturbance in self._disturbances for edge in disturbance.edges)
        self._acts_until = self._next

    def _set_outside(self, step: int) -> None:
        """Set what acts from outside around a physics step."""
        grid, place = self.controller.steps_per_sample, bisect_right(self._edges, step)
        start = max([step // grid * grid, *self._edges[:place][-1:]])
        self._acts_until = next_instant(step, grid, self._edges)
        outside = acting(self._disturbances, start, self._acts_until - start)
        self._torques = outside.torques or [0.0] * len(self._lines)
        if outside.acceleration is not None:
            self.model.opt.gravity[:] = self._gravity - outside.acceleration
        if outside.setpoints is not None:
            actuators, setpoints = outside.setpoints
            self.data.ctrl[actuators] = setpoints

    def sync_to_time(self) -> int:
        """Return the step of the state's time. If someone has moved the state, the controller goes there too.

        Where it has been before, within the last `SAVED` instants, it goes on as then; elsewhere it begins again.
        """
        step = round(self.data.time / self.timestep)
        if step == self._next:
            return step
        grid = self.controller.steps_per_sample
        saved = self._saved.get((step - 1) // grid * grid)
        if saved is None:
            self.begin()
            self.note = f"the controller starts afresh at t = {self.data.time:g} s"
            return step
        self._go_to(step)
        self._set_pushes()
        self.controller.state = saved
        self.stopped = self.note = ""
        return step

    def step(self) -> bool:
        """Advance one physics step, before which the controller takes due samples and decisions.

        No failure of an observer or of the physics raises from here.

        Returns:
            Whether there was a control tick.
        """
        data, step = self.data, self.sync_to_time()
        if step >= self._acts_until:
            self._set_outside(step)
        # Studio's mouse writes xfrc_applied: MuJoCo adds them up.
        apply_torques(data.qfrc_applied, self._lines, self._torques)
        ticked = not self.stopped and self._control()
        mujoco.mj_step(self.model, data)
        self._next = step + 1
        if not np.isfinite(data.qpos).all():
            self.diverged = True
            self._stop(f"the physics diverged at t = {data.time:g} s; reset")
        return ticked

    def _control(self) -> bool:
        data = self.data
        lean = self.plant.largest_tilt(data.qpos)
        if not abs(lean) <= math.radians(self.now.scenario.metrics.fall_angle_deg):
            self._stop(f"the rig fell at t = {data.time:g} s; reset, or go back in time")
            return False
        try:
            ticked = control(self.plant, self.controller, data)
        except (InputError, RunStopped) as error:
            self._stop(str(error))
            return False
        self._save(self.controller.state)
        if ticked:
            self.ticks.append(tuple(map(self._plotted_tick, range(len(self._lines)))))
        return ticked

    def _save(self, state: ControllerState) -> None:
        """Keep a state to go back to. A user's observer or law may remember more than its state holds."""
        if state.step is None or state is self._saved.get(state.step):
            return
        if not all(axis.is_trusted for axis in self.controller.axes):
            return
        self._saved.pop(state.step, None)
        if len(self._saved) >= SAVED:
            del self._saved[next(iter(self._saved))]
        self._saved[state.step] = state

    def _plotted_tick(self, axis: int) -> PlottedTick:
        """Return the last tick of an axis."""
        data, line, tick = self.data, self._lines[axis], self.controller.ticks[axis]
        x1 = math.degrees(float(line.lean(data.qpos)) + self.now.plant.axes[axis].bias)
        return PlottedTick(data.time, x1, float(line.rate(data.qvel)), tick.estimates[0][1], tick.u)

    def _stop(self, why: str) -> None:
        self.stopped = why
        for axis in self.plant.axes:
            self.data.ctrl[axis.servos] = 0.0

    def choose(self, values: FieldValues) -> None:
        """Change settings of the scenario on all axes; `note` has the reason of a refusal.

        The controller starts afresh at the present state.

        Args:
            values: Field, named as with `--set` -> value: the observer, the law, `controller.feedback`, the
                accelerometers' noise, e.
        """
        self.sync_to_time()
        try:
            fields = changed_fields(self.base, self.now, values)
            if self.now.scenario.plant.timestep_s is None:
                fields["plant.timestep_s"] = self.timestep  # the one it runs with
            new = self.now.with_settings(fields)
        except InputError as error:
            self.note = str(error)
            return
        source = self.base.scenario.source  # which would grow with every change
        self.now = dataclasses.replace(new, scenario=new.scenario.with_source(source))
        copy_physics_numbers(self.model, new.plant.model)  # in place, because others hold the model too
        self.restart_controller()
        self.note = "; ".join(new.hints)

    def restart_controller(self) -> None:
        """Start the controller afresh at the present state, for instance after the failure of an observer."""
        self.sync_to_time()
        self._start_controller()

    def push(self, torque: float, duration_s: float, axis: int = 0) -> None:
        """Push from now on: torque about a tilt axis by its index [N m], duration [s]."""
        step, dt = self.sync_to_time(), self.timestep
        if not (abs(torque) <= LARGEST and 0.0 < duration_s <= MAX_TIME_S):
            self.note = f"a push of {torque:g} N m for {duration_s:g} s: must be numbers, and at most {MAX_TIME_S:g} s"
            return
        duration_s = max(1, round(duration_s / dt)) * dt
        self._users_pushes.append(Push(step * dt, duration_s, torque, self.plant.axis_names[axis]))
        self._set_pushes()
