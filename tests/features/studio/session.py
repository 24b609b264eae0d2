"""A Studio session without a screen: both threads' ends in one, and a clock that goes when it is told to."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import mujoco
import numpy as np
from mujoco.studio import (
    endpoints,
    launch_thread,
    messages,
    sim,  # pyright: ignore[reportAttributeAccessIssue]
    sim_history,
    viewer_handle,
)

from cmg_mj import load_scenario, prepare
from cmg_mj.features.studio.panel import SessionState
from cmg_mj.features.studio.session import StudioSession
from cmg_mj.features.studio.settings import Settings
from cmg_mj.features.studio.stepping import Stepping
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment

SIGNALS = ("x2_rad_s", "y1_rad", "y2_rad", "fog_rad_s", "u_rad_s", "x_e_rad_times_s", "push_n_m")
MessageT = TypeVar("MessageT", bound=messages.Message)


class RecordingStepping(Stepping):
    """Keeps every tick: time, what the controller made of it on each axis, the joints."""

    def __init__(self, open_experiment: Callable[[str], Experiment], **options: Any) -> None:
        super().__init__(open_experiment, **options)
        self.rows: list[tuple[float, ...]] = []

    @messages.handler
    def on_load_model(self, event: messages.LoadModelEvent) -> bool:
        before = self.live
        is_done = super().on_load_model(event)
        if self.live is not before:
            vars(self.live)["step"] = recording(self.live, self.rows)
        return is_done


def recording(live: StudioSession, rows: list[tuple[float, ...]]) -> Callable[[], bool]:
    step, data, lines = live.step, live.data, [axis.line for axis in live.plant.axes]

    def record_step() -> bool:
        time, q, v = data.time, data.qpos.tolist(), data.qvel.tolist()
        has_ticked = step()
        if has_ticked:
            row = [time]
            for line, tick in zip(lines, live.controller.ticks, strict=True):
                push = sum(float(data.qfrc_applied[dof]) * share for dof, share in zip(*line.push, strict=True))
                row += [float(line.rate(v)), tick.y1, tick.y2, tick.fog, tick.u, tick.x_e, push]
            rows.append((*row, *q, *v))
        return has_ticked

    return record_step


class Session:
    """Studio's simulation, and what its viewer sends and hears."""

    def __init__(self, open_experiment: Callable[[str], Experiment], history_s: float = 10.0) -> None:
        self.now = 100.0
        self.stepping = RecordingStepping(open_experiment, clock=lambda: self.now, sleep=lambda _: None)
        self.viewer: endpoints.ViewerEndpoint
        self.viewer, end = launch_thread.make_thread_endpoints()
        history = sim_history.SimHistory(min_seconds=history_s)
        self.handle = viewer_handle.ViewerHandle(end, sim_plugins=[self.stepping, history])
        self.handle.dispatch(messages.LoadModelEvent())

    @property
    def live(self) -> StudioSession:
        return self.stepping.live

    @property
    def data(self) -> mujoco.MjData:
        return self.live.data

    @property
    def rows(self) -> np.ndarray:
        return np.array(self.stepping.rows)

    def send(self, *sent_messages: messages.Message) -> None:
        for message in sent_messages:
            self.viewer.send_to_sim(message)
        self.handle.sync()

    def run(self, seconds: float, every_s: float = 0.017) -> None:
        """Let the clock go so far, and the simulation with it."""
        end, most = self.data.time + seconds, self.now + 2.0 * seconds + 1.0
        while self.data.time < end - 1e-9:
            assert self.now < most, "it stands still"
            self.now += min(every_s, end - self.data.time + 1e-7)
            self.handle.sync()

    def pause(self, is_paused: bool = True) -> None:
        state = sim.PauseState.NORMAL_PAUSED if is_paused else sim.PauseState.UNPAUSED
        self.send(messages.StepControlSnapshot(pause_state=state))

    def receive(self, kind: type[MessageT]) -> list[MessageT]:
        received = [*self.viewer.get_sim_events(), *self.viewer.get_sim_snapshots()]
        return [message for message in received if isinstance(message, kind)]

    def session_state(self) -> SessionState:
        """The next state that the panel receives."""
        self.receive(SessionState)
        self.now += 1.0 / 29.0
        self.handle.sync()
        return self.receive(SessionState)[-1]

    def settings(self) -> Settings:
        settings = self.session_state().settings
        assert settings is not None
        return settings

    def scrub(self, index: int) -> None:
        """Go so many frames back in history."""
        self.send(sim_history.SimHistorySnapshot(index=index))


@contextmanager
def session(*settings: str, scenario: str = "push_recovery", **options: Any) -> Iterator[Session]:
    studio = Session(lambda path: prepare(load_scenario(scenario, list(settings))), **options)
    try:
        yield studio
    finally:
        studio.handle.close()


def as_rows(trajectory: Trajectory) -> np.ndarray:
    """A runner's trajectory as the rows of a session."""
    rates = [trajectory[name] for name in trajectory.layout.rates()]
    axes = [f"{axis}/" for axis in trajectory.axes] or [""]
    names = ("time_s", *(axis + signal for axis in axes for signal in SIGNALS))
    return np.column_stack([*(trajectory[name] for name in names), trajectory.qpos(), *rates])
