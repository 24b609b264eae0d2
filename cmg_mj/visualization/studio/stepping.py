"""Studio's simulation thread: it loads the scenario's rig, ticks its controller, and hears what the panel wants."""

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

from cmg_mj.errors import InputError
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.visualization.studio.live import StudioSession
from cmg_mj.visualization.studio.messages import ChangeSettings, PushRequest, RestartController, SessionState, ShowAxis
from cmg_mj.visualization.studio.pace import StepScheduler
from cmg_mj.visualization.studio.settings import law_of, laws_of, observers_of, settings_of

AFTER_STUDIO = 0
"""Priority of a handler that Studio's own comes before."""
SAID_EVERY_S = 1.0 / 30.0
REST_S = 0.002
"""Between two looks at what is due: without it the viewer's thread would starve."""

logger = logging.getLogger(__name__)


class Stepping(plugin.SimPlugin):
    """Steps the rig in Studio's `StepControl`'s place, at the clock's pace.

    Args:
        opened: Makes the scenario ready: of a path that was dropped on the viewer, or of none for the scenario's own.
        clock: What it keeps pace with [s].
        sleep: Takes a rest [s].

    Attributes:
        live: The scenario as it runs.
    """

    def __init__(
        self,
        opened: Callable[[str], Experiment],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._opened = opened
        self._clock = clock
        self._sleep = sleep
        self._pace = StepScheduler(clock)
        self._pause = sim.PauseState.UNPAUSED
        self._single_steps = 0
        self._said = -1.0
        self._complaint = ""
        self._axis = ""
        self.live: StudioSession | None = None

    # --- model and time ------------------------------------------------------------------------------------

    @messages.handler
    def on_load_model(self, event: messages.LoadModelEvent) -> bool:
        """Load the scenario's rig, or load it again; a model file dropped on the viewer takes the rig's place."""
        try:
            live = StudioSession(self._opened(event.path))
        except InputError as error:
            self._complain(str(error))
            return True
        self._complaint = ""
        self.live = live
        data = live.new_data()
        self.handle.set_model(live.model, data=data)
        self._pace.begin(data.time)
        return True

    @messages.handler(priority=AFTER_STUDIO)
    def on_reset(self, event: messages.ResetEvent) -> None:
        """Begin again: at the scenario's initial state, or at the keyframe that the user has picked."""
        live, data = self.live, self.handle.data
        if live is None or data is None:
            return
        if event.key is None or not 0 <= event.key < live.model.nkey:
            live.start(data)
        else:
            live.begin(data)
        self._pace.begin(data.time)

    @messages.handler
    def on_step(self, event: messages.StepEvent) -> bool:
        """As many physics steps as are due by the clock."""
        live, data = self.live, event.data
        if live is None:
            self._sleep(REST_S)
            return True
        if event.model.opt.timestep != live.timestep:
            event.model.opt.timestep = live.timestep
            self._complain(f"the physics step stays {live.timestep:g} s: samples and ticks fall on whole steps")
        before = self._state()
        if self._pause == sim.PauseState.UNPAUSED:
            due = self._pace.steps_due(data.time, live.timestep)
        else:
            due, self._single_steps = self._single_steps, 0
            self._pace.begin(data.time + due * live.timestep)
        for _ in range(due):
            live.step(data)
            if live.diverged:
                self._pause = sim.PauseState.NORMAL_PAUSED  # nothing is left to be seen
                break
        if self._state() != before:
            self.handle.send_to_viewer(self._state())
        now = self._clock()
        if not 0.0 <= now - self._said < SAID_EVERY_S:
            self._said = now
            self.handle.send_to_viewer(self.standing())
        self._sleep(REST_S)
        return True

    # --- Studio's step control -----------------------------------------------------------------------------

    def _state(self) -> messages.StepControlSnapshot:
        measured = 5.0 * round(self._pace.measured / 5.0)  # reported when it changes
        return messages.StepControlSnapshot(
            pause_state=self._pause, speed=self._pace.speed, speed_measured=measured if measured >= 0.0 else -1.0
        )

    @messages.handler
    def on_step_control(self, event: messages.StepControlSnapshot) -> bool:
        """The user pauses, goes on, or sets the speed."""
        self._pause, self._pace.speed = event.pause_state, event.speed
        if self.handle.data is not None:
            self._pace.begin(self.handle.data.time)
        if event.noise_scale:
            self._complain("Studio's noise on the controls is not applied: set the accelerometers' noise here")
        return True

    @messages.handler
    def on_pause(self, event: messages.RequestPauseEvent) -> bool:
        """Something else in Studio, such as its history, pauses."""
        self._pause = event.pause_state
        self.handle.send_to_viewer(self._state())
        return True

    @messages.handler
    def on_single_step(self, _: messages.SingleStepEvent) -> bool:
        """One physics step while it is paused."""
        self._single_steps += self._pause != sim.PauseState.UNPAUSED
        return True

    # --- the panel -----------------------------------------------------------------------------------------

    @messages.handler
    def on_choose(self, event: ChangeSettings) -> None:
        """Change settings of the scenario."""
        if self.live is not None and self.handle.data is not None:
            self._complaint = ""
            self.live.choose(self.handle.data, event.values)

    @messages.handler
    def on_push(self, event: PushRequest) -> None:
        """Push."""
        if self.live is not None and self.handle.data is not None:
            self.live.push(self.handle.data, event.torque_n_m, event.duration_s, self._shown(self.live))

    @messages.handler
    def on_show_axis(self, event: ShowAxis) -> None:
        """Show another axis, and push about it from now on."""
        self._axis = event.axis

    def _shown(self, live: StudioSession) -> int:
        """The place of the axis that is shown: of the one that was chosen, if the rig has it, or else the first."""
        names = live.plant.axis_names
        return names.index(self._axis) if self._axis in names else 0

    @messages.handler
    def on_start_again(self, _: RestartController) -> None:
        """Start a controller that has stopped."""
        if self.live is not None and self.handle.data is not None:
            self.live.restart_controller(self.handle.data)

    def _complain(self, what: str) -> None:
        self._complaint = what
        logger.warning("%s", what)

    def standing(self) -> SessionState:
        """Where things stand, for the panel."""
        live, data = self.live, self.handle.data
        if live is None or data is None:
            return SessionState(note=self._complaint)
        now, stopped = live.settings_at(data)
        axis = self._shown(live)
        own = now.parts[axis]
        ticks = np.array([tick[axis] for tick in live.ticks if tick[axis].time_s < data.time - 1e-9]).reshape(-1, 6)
        return SessionState(
            title=now.scenario.title,
            time_s=data.time,
            axes=tuple(live.plant.axis_names),
            axis=live.plant.axis_names[axis],
            settings=settings_of(own.scenario),
            observers=observers_of(live.base),
            gains=tuple(getattr(own.law, "gains", ())),
            laws=laws_of(live.base),
            law=law_of(live.base, now),
            stopped=stopped,
            note=self._complaint or live.note,
            ticks=ticks,
        )
