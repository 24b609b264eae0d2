"""Records a run piece by piece while it goes on; at the end the recording has all that a finished run's has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.results.result import Outcome
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.visualization.recording.blueprint import default_blueprint
from cmg_mj.visualization.recording.branch import Branch, make_branches
from cmg_mj.visualization.recording.run import (
    SETTLED,
    RecordingHeader,
    Run,
    largest_torque,
    phases,
    pose_stride,
    poses_at,
    torque_steps,
)
from cmg_mj.visualization.recording.scene import log_poses, log_shapes, log_torques
from cmg_mj.visualization.recording.signals import (
    Lines,
    log_lane,
    log_phases,
    log_styles,
    log_values,
    phase_steps,
    run_series,
)
from cmg_mj.visualization.recording.stream import log_page
from cmg_mj.visualization.recording.summary import log_results, log_scenario

END_MARGIN_S = 1e-6
"""Time from the last tick to the assumed end of an unfinished run [s]."""


@dataclass(frozen=True)
class BranchSpec:
    """A branch before the first tick.

    Attributes:
        name: Name of the branch: usually the observer in the loop; of several axes, the axis.
        bias_deg: The true bias, which an observer of the bias should find [deg].
        axis: The axis, if the plant has several.
    """

    name: str
    bias_deg: float
    axis: str | None = None

    def run_until(self, trajectory: Trajectory, end_s: float) -> Run:
        """Make the run of the branch so far, which is taken to end now [s]."""
        bias = {"bias_deg": self.bias_deg}
        summary = {**bias, "open_loop_observers": dict.fromkeys(trajectory.observers[1:], bias)}
        return Run(self.name, trajectory, summary, Outcome("done", end_s), self.axis)


@dataclass(frozen=True)
class StreamHeader:
    """A run before its first tick.

    Attributes:
        experiment: The experiment of the run.
        branches: One branch; of several axes, a branch for each axis.
        dt: Control period [s].
    """

    experiment: RecordingHeader
    branches: Sequence[BranchSpec]
    dt: float


class StreamedRun:
    """A run in a recording, which grows by pieces of ticks.

    Args:
        header: The run before its first tick.
        empty: The trajectory before the first tick: all columns, no row.
    """

    def __init__(self, header: StreamHeader, empty: Trajectory) -> None:
        self.header = header
        self._ticks = 0
        runs = [spec.run_until(_select_axis(empty, spec.axis), 0.0) for spec in header.branches]
        branches = make_branches(header.experiment, runs)
        pairs = zip(header.branches, branches, strict=True)
        self._branches = [_StreamedBranch(header, spec, branch) for spec, branch in pairs]

    @property
    def branches(self) -> list[Branch]:
        """The branches before the first tick."""
        return [stream.branch for stream in self._branches]

    def blueprint(self) -> rrb.Blueprint:
        """Lay out the recording before the best observers and the ranges of the axes are known."""
        return default_blueprint(self.header.experiment.plant, self.branches, live=True)

    def begin(self, rec: rr.RecordingStream) -> None:
        """Record shapes, styles, the scenario and a page for the meantime."""
        for stream in self._branches:
            stream.begin(rec)
        log_scenario(rec, self.header.experiment.scenario_toml)
        title = self.header.experiment.title or "Run"
        log_page(rec, "summary", f"# {title}\n\nIt goes on; its figures come when it has ended.")

    def add(self, rec: rr.RecordingStream, piece: Trajectory) -> None:
        """Record the next ticks."""
        self._ticks += len(piece)
        if len(piece):
            for stream in self._branches:
                stream.add(rec, _select_axis(piece, stream.spec.axis))

    def end(self, rec: rr.RecordingStream, runs: Sequence[Run]) -> rrb.Blueprint:
        """Record the last ticks and the results of the finished run.

        Args:
            rec: The recording.
            runs: The whole run, a `Run` for each branch.

        Returns:
            The layout, the one of `write_recording`.
        """
        branches = make_branches(self.header.experiment, runs)
        for stream, branch in zip(self._branches, branches, strict=True):
            stream.end(rec, branch, branch.run.trajectory.from_tick(self._ticks))
        log_results(rec, self.header.experiment, branches)
        return default_blueprint(self.header.experiment.plant, branches, live=True)


class _StreamedBranch:
    """A branch of a streamed run.

    Args:
        header: The run before its first tick.
        spec: The branch, as it is known before its first tick.
        branch: The branch before its first tick.
    """

    def __init__(self, header: StreamHeader, spec: BranchSpec, branch: Branch) -> None:
        self.spec, self.branch, self.path = spec, branch, branch.path
        self._header = header.experiment
        self._plant, self._pushes, self._radius = branch.plant, branch.pushes, branch.radius
        self._stride = pose_stride(header.dt)
        self._torques = torque_steps(self._pushes, math.inf)
        self._largest = largest_torque(self._pushes)
        self._ticks = self._n_torques = self._n_phases = 0
        self._past = branch.run.trajectory

    def begin(self, rec: rr.RecordingStream) -> None:
        log_shapes(rec, self.path, self._plant, self._radius)
        log_styles(rec, self.branch)
        log_lane(rec, self.path)

    def add(self, rec: rr.RecordingStream, piece: Trajectory) -> None:
        if not len(piece):
            return
        time = piece["time_s"]
        end = float(time[-1]) + END_MARGIN_S
        log_values(rec, self._lines(self.spec.run_until(piece, end)))
        has_pose = (self._ticks + np.arange(len(piece))) % self._stride == 0
        if has_pose.any():
            log_poses(rec, self.path, self._plant, time[has_pose], piece.qpos()[has_pose])
        self._ticks += len(piece)
        self._push(rec, [step for step in self._torques if step[0] < end])
        columns = {name: np.concatenate([self._past[name], piece[name]]) for name in ("time_s", "x1_rad")}
        self._past = Trajectory(columns, layout=piece.layout)
        steps = phases(self.spec.run_until(self._past, end), self._pushes, self._header.settings)
        if steps and steps[-1][1] == SETTLED:  # the rig may still leave the band before the next push
            steps.pop()
        self._phase(rec, steps)

    def end(self, rec: rr.RecordingStream, branch: Branch, last: Trajectory) -> None:
        end = branch.run.outcome.time_s
        self.add(rec, last)
        if not self._ticks or (self._ticks - 1) % self._stride:
            poses = poses_at(self._plant, branch.run.trajectory, branch.pose_ticks[-1:])
            log_poses(rec, self.path, self._plant, *poses)
        self._push(rec, torque_steps(self._pushes, end))
        self._phase(rec, phase_steps(branch.run, self._pushes, self._header.settings, end))

    def _lines(self, run: Run) -> Lines:
        branch, header = self.branch, self._header
        rows = run_series(run, self._plant, branch.observers, header.settings, header.rate_limit_rad_s)
        return Lines(path=branch.path, label=branch.label, series={row.path: row for row in rows})

    def _push(self, rec: rr.RecordingStream, steps: Sequence[tuple[float, float]]) -> None:
        log_torques(rec, self.path, self._plant, steps[self._n_torques :], self._largest, self._radius)
        self._n_torques = len(steps)

    def _phase(self, rec: rr.RecordingStream, steps: Sequence[tuple[float, str]]) -> None:
        log_phases(rec, self.path, steps[self._n_phases :])
        self._n_phases = len(steps)


def _select_axis(trajectory: Trajectory, axis: str | None) -> Trajectory:
    return trajectory if axis is None else trajectory.along(axis)
