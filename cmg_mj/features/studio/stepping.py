"""Studio's simulation thread: loads the scenario, steps plant and controller in time, handles the panel's messages."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import numpy as np
from mujoco.studio import (
    messages,
    plugin,
    sim,  # pyright: ignore[reportAttributeAccessIssue]  # made by Studio's binary
)

from cmg_mj.core.errors import InputError
from cmg_mj.features.studio.panel import ChangeSettings, PushRequest, RestartController, SessionState, ShowAxis
from cmg_mj.features.studio.session import StudioSession
from cmg_mj.features.studio.settings import choosable_observers, current_settings
from cmg_mj.runs.experiment import Experiment

AFTER_STUDIO = 0
"""Priority of a handler after Studio's."""
STATE_INTERVAL_S = 1.0 / 30.0
"""Interval between two states for the panel [s]."""
REST_S = 0.002
"""Pause between two checks for due steps, without which the viewer's thread would starve [s]."""
MAX_BEHIND_S = 0.1
"""Largest delay that the simulation catches up; it discards more [s]."""

logger = logging.getLogger(__name__)


class Stepping(plugin.SimPlugin):
    """Steps the plant in place of Studio's `StepControl`, at a clock's pace.

    Args:
        load: Prepares the scenario with a model that was dropped on the viewer; for an empty path, with its own.
        clock: Returns the time [s].
        sleep: Pauses the thread [s].

    Attributes:
        live: The session.
    """

    def __init__(
        self,
        load: Callable[[str], Experiment],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._load = load
        self._clock = clock
        self._sleep = sleep
        self._speed = 100.0
        self._pause = sim.PauseState.UNPAUSED
        self._single_steps = 0
        self._state_sent_at = -1.0
        self._complaint = ""
        self._axis = ""
        self._begin_pacing(0.0)
        self.live = StudioSession(load(""))

    def _begin_pacing(self, time: float) -> None:
        """Go on in the clock's time from now, at a simulated time [s]."""
        self._from = self._clock(), time

    def _steps_due(self, time: float, timestep: float) -> int:
        """Return the number of physics steps due at a simulated time [s]."""
        now, (since, start) = self._clock(), self._from
        behind = start + (now - since) * self._speed / 100.0 - time
        if behind > MAX_BEHIND_S:
            self._from = now, time + MAX_BEHIND_S
            behind = MAX_BEHIND_S
        return max(0, int(behind / timestep + 1e-6))

    @messages.handler
    def on_load_model(self, event: messages.LoadModelEvent) -> bool:
        """Load the scenario, or load it again; a model file dropped on the viewer replaces the scenario's."""
        try:
            self.live = live = StudioSession(self._load(event.path))
        except InputError as error:
            self._complain(str(error))
            return True
        self._complaint = ""
        self.handle.set_model(live.model, data=live.data)
        self._begin_pacing(live.data.time)
        return True

    @messages.handler(priority=AFTER_STUDIO)
    def on_reset(self, event: messages.ResetEvent) -> None:
        """Begin again at the scenario's initial state, or at the user's keyframe."""
        live = self.live
        if event.key is None or not 0 <= event.key < live.model.nkey:
            live.start()
        else:
            live.begin()
        self._begin_pacing(live.data.time)

    @messages.handler
    def on_step(self, event: messages.StepEvent) -> bool:
        """Advance the physics steps that are due."""
        live, data = self.live, self.live.data
        if event.model.opt.timestep != live.timestep:
            event.model.opt.timestep = live.timestep
            self._complain(f"the physics step stays {live.timestep:g} s: samples and ticks fall on whole steps")
        if self._pause == sim.PauseState.UNPAUSED:
            due = self._steps_due(data.time, live.timestep)
        else:
            due, self._single_steps = self._single_steps, 0
            self._begin_pacing(data.time + due * live.timestep)
        for _ in range(due):
            live.step()
            if live.diverged:
                self._pause = sim.PauseState.NORMAL_PAUSED  # there is nothing more to show
                self.handle.send_to_viewer(self._state())
                break
        now = self._clock()
        if not 0.0 <= now - self._state_sent_at < STATE_INTERVAL_S:
            self._state_sent_at = now
            self.handle.send_to_viewer(self.session_state())
        self._sleep(REST_S)
        return True

    def _state(self) -> messages.StepControlSnapshot:
        return messages.StepControlSnapshot(pause_state=self._pause, speed=self._speed)

    @messages.handler
    def on_step_control(self, event: messages.StepControlSnapshot) -> bool:
        """Handle the user's pause, resumption, or speed."""
        self._pause, self._speed = event.pause_state, event.speed
        self._begin_pacing(self.live.data.time)
        if event.noise_scale:
            self._complain("Studio's noise on the controls is not applied: set the accelerometers' noise here")
        return True

    @messages.handler
    def on_pause(self, event: messages.RequestPauseEvent) -> bool:
        """Handle a pause by another part of Studio, such as its history."""
        self._pause = event.pause_state
        self.handle.send_to_viewer(self._state())
        return True

    @messages.handler
    def on_single_step(self, _: messages.SingleStepEvent) -> bool:
        """Request a physics step during a pause."""
        self._single_steps += self._pause != sim.PauseState.UNPAUSED
        return True

    @messages.handler
    def on_choose(self, event: ChangeSettings) -> None:
        """Change settings of the scenario."""
        self._complaint = ""
        self.live.choose(event.values)

    @messages.handler
    def on_push(self, event: PushRequest) -> None:
        """Push about the axis shown."""
        self.live.push(event.torque_n_m, event.duration_s, self._axis_index())

    @messages.handler
    def on_show_axis(self, event: ShowAxis) -> None:
        """Show and push another axis from now on."""
        self._axis = event.axis

    def _axis_index(self) -> int:
        """Return the index of the axis shown: the user's choice, or the first if the plant lacks the choice."""
        names = self.live.plant.axis_names
        return names.index(self._axis) if self._axis in names else 0

    @messages.handler
    def on_start_again(self, _: RestartController) -> None:
        """Restart a controller that has stopped."""
        self.live.restart_controller()

    def _complain(self, message: str) -> None:
        self._complaint = message
        logger.warning("%s", message)

    def session_state(self) -> SessionState:
        """Describe the session for the panel."""
        live, axis = self.live, self._axis_index()
        now, data = live.now, live.data
        part = now.axes[axis]
        ticks = np.array([tick[axis] for tick in live.ticks if tick[axis].time_s < data.time - 1e-9]).reshape(-1, 5)
        return SessionState(
            title=now.scenario.title,
            time_s=data.time,
            axes=tuple(live.plant.axis_names),
            axis=live.plant.axis_names[axis],
            settings=current_settings(part.scenario),
            observers=choosable_observers(live.base),
            gains=tuple(getattr(part.law, "gains", ())),
            stopped=live.stopped,
            note=self._complaint or live.note,
            ticks=ticks,
        )
