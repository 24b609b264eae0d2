"""A run on its way into a recording while it goes on: piece by piece, and in the end all that a finished one has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.plant.plant import Plant
from cmg_mj.results.result import Outcome
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.disturbances import Push
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.visualization.plots.readability import short_names
from cmg_mj.visualization.recording.blueprint import default_blueprint
from cmg_mj.visualization.recording.camera import ball
from cmg_mj.visualization.recording.pages import log_results, log_scenario
from cmg_mj.visualization.recording.run import SETTLED, Run, phases, torque_steps
from cmg_mj.visualization.recording.scene import (
    log_poses,
    log_shapes,
    log_torques,
    pose_samples,
    pose_stride,
    size,
    strongest,
)
from cmg_mj.visualization.recording.signals import (
    Branch,
    Lines,
    log_lane,
    log_phases,
    log_styles,
    log_values,
    numbered,
    phase_steps,
    series,
)
from cmg_mj.visualization.recording.stream import log_page

NOW = 1e-6
"""So long after its last tick a run that goes on is taken to have come [s]."""


@dataclass(frozen=True)
class BranchSpec:
    """What is known of one branch before the first tick.

    Attributes:
        name: Of the branch: usually the observer in the loop, of several axes the axis.
        bias_deg: What an observer of the bias should find [deg].
        axis: Which of the rig's axes, if it has several.
    """

    name: str
    bias_deg: float
    axis: str | None = None


@dataclass(frozen=True)
class StreamHeader:
    """What is known of a run before its first tick.

    Attributes:
        branches: One; of several axes one an axis.
        plant: The rig.
        dt: Control period [s].
        title: The experiment's title.
        pushes: Torques from outside.
        settings: What counts as settled.
        rate_limit_rad_s: Largest gimbal rate [rad/s].
        scenario_toml: The resolved scenario.
    """

    branches: Sequence[BranchSpec]
    plant: Plant
    dt: float
    title: str
    pushes: Sequence[Push]
    settings: MetricsSettings
    rate_limit_rad_s: float
    scenario_toml: str


class StreamedRun:
    """One run in a recording, ticks after ticks.

    Args:
        shown: What is known of it.
        empty: Its trajectory before the first tick: all columns, no row.
    """

    def __init__(self, shown: StreamHeader, empty: Trajectory) -> None:
        self.shown = shown
        self._ticks = 0
        names = [named.name for named in shown.branches]
        places = zip(shown.branches, numbered(names), short_names(names).values(), strict=True)
        self._branches = [
            _StreamedBranch(shown, named, f"/{part}", label, _along(empty, named.axis)) for named, part, label in places
        ]

    @property
    def branches(self) -> list[Branch]:
        """Its branches, before the first tick."""
        return [growing.branch for growing in self._branches]

    def blueprint(self) -> rrb.Blueprint:
        """How it opens while nothing is known of the best observers and the axes."""
        return default_blueprint(self.shown.plant, self.branches, live=True)

    def begin(self, rec: rr.RecordingStream) -> None:
        """Record what never changes."""
        for growing in self._branches:
            growing.begin(rec)
        log_scenario(rec, self.shown.scenario_toml)
        log_page(rec, "summary", f"# {self.shown.title or 'Run'}\n\nIt goes on; its figures come when it has ended.")

    def add(self, rec: rr.RecordingStream, piece: Trajectory) -> None:
        """Record the next ticks."""
        self._ticks += len(piece)
        if len(piece):
            for growing in self._branches:
                growing.add(rec, _along(piece, growing.named.axis))

    def end(self, rec: rr.RecordingStream, runs: Sequence[Run]) -> rrb.Blueprint:
        """Record the last ticks, and what is known only of a run that has ended.

        Args:
            rec: The recording.
            runs: All of it, a run a branch.

        Returns:
            How it opens now, as with `write_recording`.
        """
        shown = self.shown
        pairs = list(zip(self._branches, runs, strict=True))
        for growing, run in pairs:
            growing.end(rec, run, run.trajectory.from_tick(self._ticks))
        log_results(rec, runs, shown.title, shown.pushes, shown.settings)
        return default_blueprint(shown.plant, [growing.of(run) for growing, run in pairs], live=True)


class _StreamedBranch:
    """One branch of it: the run, or an axis'.

    Args:
        shown: What is known of the run.
        named: What of the branch.
        path: Of the branch.
        label: Its name, shortened.
        empty: Its trajectory before the first tick.
    """

    def __init__(self, shown: StreamHeader, named: BranchSpec, path: str, label: str, empty: Trajectory) -> None:
        self.named, self.path, self._label = named, path, label
        self._shown = shown
        self._plant = shown.plant if named.axis is None else shown.plant.single_axis(named.axis)
        self._radius = size(self._plant)
        self._stride = pose_stride(shown.dt)
        self._pushes = self._so_far(empty, 0.0).pushes_on_axis(shown.pushes)
        self._torques = torque_steps(self._pushes, math.inf)
        self._largest = strongest(self._pushes)
        self._ticks = self._pushed = self._phased = 0
        self._past = empty
        self.branch = self.of(self._so_far(empty, 0.0))

    def begin(self, rec: rr.RecordingStream) -> None:
        log_shapes(rec, self.path, self._plant, self._radius)
        log_styles(rec, self.branch)
        log_lane(rec, self.path)

    def add(self, rec: rr.RecordingStream, piece: Trajectory) -> None:
        if not len(piece):
            return
        time = piece["time_s"]
        now = float(time[-1]) + NOW
        log_values(rec, self._lines(self._so_far(piece, now)))
        posed = (self._ticks + np.arange(len(piece))) % self._stride == 0
        if posed.any():
            log_poses(rec, self.path, self._plant, time[posed], piece.qpos()[posed])
        self._ticks += len(piece)
        self._push(rec, [step for step in self._torques if step[0] < now])
        columns = {name: np.concatenate([self._past[name], piece[name]]) for name in ("time_s", "x1_rad")}
        self._past = Trajectory(columns, layout=piece.layout)
        steps = phases(self._so_far(self._past, now), self._pushes, self._shown.settings)
        if steps and steps[-1][1] == SETTLED:  # until the next push it may yet turn out to have been too early
            steps.pop()
        self._phase(rec, steps)

    def end(self, rec: rr.RecordingStream, run: Run, last: Trajectory) -> None:
        end = run.outcome.time_s
        self.add(rec, last)
        time, qpos = pose_samples(self._plant, run)
        if not self._ticks or (self._ticks - 1) % self._stride:
            log_poses(rec, self.path, self._plant, time[-1:], qpos[-1:])
        self._push(rec, torque_steps(self._pushes, end))
        self._phase(rec, phase_steps(run, self._pushes, self._shown.settings, end))

    def of(self, run: Run) -> Branch:
        """The branch with a run, as far as it has come."""
        lines = self._lines(run)
        rig = ball(self._plant, pose_samples(self._plant, run)[1])
        return Branch(path=lines.path, label=lines.label, series=lines.series, run=run, rig=rig)

    def _so_far(self, trajectory: Trajectory, now: float) -> Run:
        named = self.named
        bias = {"bias_deg": named.bias_deg}
        summary = {**bias, "open_loop_observers": dict.fromkeys(trajectory.observers[1:], bias)}
        return Run(named.name, trajectory, summary, Outcome("done", now), named.axis)

    def _lines(self, run: Run) -> Lines:
        rows = series(run, self._plant, self._shown.settings, self._shown.rate_limit_rad_s)
        return Lines(path=self.path, label=self._label, series={row.path: row for row in rows})

    def _push(self, rec: rr.RecordingStream, steps: Sequence[tuple[float, float]]) -> None:
        log_torques(rec, self.path, self._plant, steps[self._pushed :], self._largest, self._radius)
        self._pushed = len(steps)

    def _phase(self, rec: rr.RecordingStream, steps: Sequence[tuple[float, str]]) -> None:
        log_phases(rec, self.path, steps[self._phased :])
        self._phased = len(steps)


def _along(trajectory: Trajectory, axis: str | None) -> Trajectory:
    return trajectory if axis is None else trajectory.along(axis)
