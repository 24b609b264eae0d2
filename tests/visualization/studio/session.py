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
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.visualization.studio.live import StudioSession
from cmg_mj.visualization.studio.messages import SessionState
from cmg_mj.visualization.studio.settings import Settings
from cmg_mj.visualization.studio.stepping import Stepping

SIGNALS = ("x2_rad_s", "y1_rad", "y2_rad", "fog_rad_s", "u_rad_s", "x_e_rad_times_s", "push_n_m")
Said = TypeVar("Said", bound=messages.Message)


class Recorded(Stepping):
    """Keeps every tick: time, what the controller made of it on each axis, the joints."""

    def __init__(self, opened: Callable[[str], Experiment], **others: Any) -> None:
        super().__init__(opened, **others)
        self.rows: list[tuple[float, ...]] = []

    @messages.handler
    def on_load_model(self, event: messages.LoadModelEvent) -> bool:
        before = self.live
        done = super().on_load_model(event)
        if self.live is not None and self.live is not before:
            vars(self.live)["step"] = recording(self.live, self.rows)
        return done


def recording(live: StudioSession, rows: list[tuple[float, ...]]) -> Callable[[mujoco.MjData], bool]:
    step, lines = live.step, [axis.line for axis in live.plant.axes]

    def recorded(data: mujoco.MjData) -> bool:
        time, q, v = data.time, data.qpos.tolist(), data.qvel.tolist()
        ticked = step(data)
        if ticked:
            row = [time]
            for line, part in zip(lines, live.controller.parts, strict=True):
                tick = part.tick
                assert tick is not None
                push = sum(float(data.qfrc_applied[dof]) * share for dof, share in zip(*line.push, strict=True))
                row += [float(line.rate(v)), tick.y1, tick.y2, tick.fog, tick.u, tick.x_e, push]
            rows.append((*row, *q, *v))
        return ticked

    return recorded


class Session:
    """Studio's simulation, and what its viewer sends and hears."""

    def __init__(self, opened: Callable[[str], Experiment], history_s: float = 10.0) -> None:
        self.now = 100.0
        self.stepping = Recorded(opened, clock=lambda: self.now, sleep=lambda _: None)
        self.viewer: endpoints.ViewerEndpoint
        self.viewer, end = launch_thread.make_thread_endpoints()
        history = sim_history.SimHistory(min_seconds=history_s)
        self.handle = viewer_handle.ViewerHandle(end, sim_plugins=[self.stepping, history])
        self.handle.dispatch(messages.LoadModelEvent())

    @property
    def live(self) -> StudioSession:
        assert self.stepping.live is not None
        return self.stepping.live

    @property
    def data(self) -> mujoco.MjData:
        assert self.handle.data is not None
        return self.handle.data

    @property
    def rows(self) -> np.ndarray:
        return np.array(self.stepping.rows)

    def send(self, *said: messages.Message) -> None:
        for message in said:
            self.viewer.send_to_sim(message)
        self.handle.sync()

    def run(self, seconds: float, every_s: float = 0.017) -> None:
        """Let the clock go so far, and the simulation with it."""
        until, most = self.data.time + seconds, self.now + 2.0 * seconds + 1.0
        while self.data.time < until - 1e-9:
            assert self.now < most, "it stands still"
            self.now += min(every_s, until - self.data.time + 1e-7)
            self.handle.sync()

    def pause(self, paused: bool = True) -> None:
        state = sim.PauseState.NORMAL_PAUSED if paused else sim.PauseState.UNPAUSED
        self.send(messages.StepControlSnapshot(pause_state=state))

    def heard(self, kind: type[Said]) -> list[Said]:
        said = [*self.viewer.get_sim_events(), *self.viewer.get_sim_snapshots()]
        return [message for message in said if isinstance(message, kind)]

    def session_state(self) -> SessionState:
        """The next state that the panel receives."""
        self.heard(SessionState)
        self.now += 1.0 / 29.0
        self.handle.sync()
        return self.heard(SessionState)[-1]

    def settings(self) -> Settings:
        settings = self.session_state().settings
        assert settings is not None
        return settings

    def scrub(self, index: int) -> None:
        """Go so many frames back in history."""
        self.send(sim_history.SimHistorySnapshot(index=index))


@contextmanager
def session(*settings: str, scenario: str = "push_recovery", **others: Any) -> Iterator[Session]:
    opened = Session(lambda path: prepare(load_scenario(scenario, list(settings))), **others)
    try:
        yield opened
    finally:
        opened.handle.close()


def as_rows(trajectory: Trajectory) -> np.ndarray:
    """A runner's trajectory as the rows of a session."""
    rates = [trajectory[name] for name in trajectory.layout.rates()]
    axes = [f"{axis}/" for axis in trajectory.axes] or [""]
    names = ("time_s", *(axis + signal for axis in axes for signal in SIGNALS))
    return np.column_stack([*(trajectory[name] for name in names), trajectory.qpos(), *rates])
