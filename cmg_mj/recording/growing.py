"""A run on its way into a recording while it goes on: piece by piece, and in the end all that a finished one has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.legible import shortened
from cmg_mj.metrics import MetricsSettings
from cmg_mj.plant import Plant
from cmg_mj.push import Push
from cmg_mj.recording.about import log_results, log_scenario
from cmg_mj.recording.blueprint import default_blueprint
from cmg_mj.recording.framing import ball
from cmg_mj.recording.run import SETTLED, Run, phases, torque_steps
from cmg_mj.recording.scene import log_poses, log_shapes, log_torques, pose_samples, pose_stride, size, strongest
from cmg_mj.recording.signals import (
    Branch,
    Lines,
    log_lane,
    log_looks,
    log_phases,
    log_values,
    numbered,
    phase_steps,
    series,
)
from cmg_mj.recording.stream import log_page
from cmg_mj.simulate import Outcome
from cmg_mj.trajectory import Trajectory

NOW = 1e-6
"""So long after its last tick a run that goes on is taken to have come [s]."""


@dataclass(frozen=True)
class Shown:
    """What is known of a run before its first tick.

    Attributes:
        name: Its branch, usually the observer in the loop.
        plant: The rig.
        dt: Control period [s].
        title: The experiment's title.
        pushes: Torques from outside.
        settings: What counts as settled.
        rate_limit_rad_s: Largest gimbal rate [rad/s].
        bias_deg: What an observer of the bias should find [deg].
        scenario_toml: The resolved scenario.
    """

    name: str
    plant: Plant
    dt: float
    title: str
    pushes: Sequence[Push]
    settings: MetricsSettings
    rate_limit_rad_s: float
    bias_deg: float
    scenario_toml: str


class Growing:
    """One run in a recording, ticks after ticks.

    Args:
        shown: What is known of it.
        empty: Its trajectory before the first tick: all columns, no row.
    """

    def __init__(self, shown: Shown, empty: Trajectory) -> None:
        self.shown = shown
        (part,) = numbered([shown.name])
        self.path = f"/{part}"
        self._radius = size(shown.plant)
        self._stride = pose_stride(shown.dt)
        self._torques = torque_steps(shown.pushes, math.inf)
        self._largest = strongest(shown.pushes)
        self._ticks = self._pushed = self._phased = 0
        self._past = empty
        self.branch = self._branch(self._so_far(empty, 0.0))

    def blueprint(self) -> rrb.Blueprint:
        """How it opens while nothing is known of the best observers and the axes."""
        return default_blueprint(self.shown.plant, [self.branch], live=True)

    def begin(self, rec: rr.RecordingStream) -> None:
        """Record what never changes."""
        log_shapes(rec, self.path, self.shown.plant, self._radius)
        log_looks(rec, self.branch)
        log_lane(rec, self.path)
        log_scenario(rec, self.shown.scenario_toml)
        log_page(rec, "summary", f"# {self.shown.title or 'Run'}\n\nIt goes on; its figures come when it has ended.")

    def add(self, rec: rr.RecordingStream, piece: Trajectory) -> None:
        """Record the next ticks."""
        if not len(piece):
            return
        time = piece["time_s"]
        now = float(time[-1]) + NOW
        log_values(rec, self._lines(self._so_far(piece, now)))
        posed = (self._ticks + np.arange(len(piece))) % self._stride == 0
        if posed.any():
            log_poses(rec, self.path, self.shown.plant, time[posed], piece.qpos()[posed])
        self._ticks += len(piece)
        self._push(rec, [step for step in self._torques if step[0] < now])
        columns = {name: np.concatenate([self._past[name], piece[name]]) for name in ("time_s", "x1_rad")}
        self._past = Trajectory(columns, layout=piece.layout)
        steps = phases(self._so_far(self._past, now), self.shown.pushes, self.shown.settings)
        if steps and steps[-1][1] == SETTLED:  # until the next push it may yet turn out to have been too early
            steps.pop()
        self._phase(rec, steps)

    def end(self, rec: rr.RecordingStream, run: Run) -> rrb.Blueprint:
        """Record the last ticks, and what is known only of a run that has ended.

        Args:
            rec: The recording.
            run: All of it.

        Returns:
            How it opens now, as with `write_recording`.
        """
        shown, end = self.shown, run.outcome.time_s
        self.add(rec, run.trajectory.from_tick(self._ticks))
        time, qpos = pose_samples(shown.plant, run)
        if not self._ticks or (self._ticks - 1) % self._stride:
            log_poses(rec, self.path, shown.plant, time[-1:], qpos[-1:])
        self._push(rec, torque_steps(shown.pushes, end))
        self._phase(rec, phase_steps(run, shown.pushes, shown.settings, end))
        log_results(rec, [run], shown.title, shown.pushes, shown.settings)
        return default_blueprint(shown.plant, [self._branch(run)], live=True)

    def _so_far(self, trajectory: Trajectory, now: float) -> Run:
        shown = self.shown
        bias = {"bias_deg": shown.bias_deg}
        summary = {**bias, "companions": dict.fromkeys(trajectory.observers[1:], bias)}
        return Run(shown.name, trajectory, summary, Outcome("done", now))

    def _lines(self, run: Run) -> Lines:
        (label,) = shortened([run.name]).values()
        rows = series(run, self.shown.plant, self.shown.settings, self.shown.rate_limit_rad_s)
        return Lines(path=self.path, label=label, series={row.path: row for row in rows})

    def _branch(self, run: Run) -> Branch:
        lines, plant = self._lines(run), self.shown.plant
        rig = ball(plant, pose_samples(plant, run)[1])
        return Branch(path=lines.path, label=lines.label, series=lines.series, run=run, rig=rig)

    def _push(self, rec: rr.RecordingStream, steps: Sequence[tuple[float, float]]) -> None:
        log_torques(rec, self.path, self.shown.plant, steps[self._pushed :], self._largest, self._radius)
        self._pushed = len(steps)

    def _phase(self, rec: rr.RecordingStream, steps: Sequence[tuple[float, str]]) -> None:
        log_phases(rec, self.path, steps[self._phased :])
        self._phased = len(steps)
