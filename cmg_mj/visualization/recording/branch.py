"""A run with all that its branch of a recording shows, computed once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.disturbances import Push
from cmg_mj.visualization.plots.readability import short_names
from cmg_mj.visualization.recording.camera import Ball, enclosing_ball
from cmg_mj.visualization.recording.run import RecordingHeader, Run
from cmg_mj.visualization.recording.signals import Lines, numbered_parts, run_series

POSE_RATE_HZ = 100.0
"""Largest rate at which poses are recorded; the eye needs no more."""


@dataclass(frozen=True, kw_only=True)
class Branch(Lines):
    """A run and its place in the recording.

    Attributes:
        run: The run.
        plant: The plant; of several axes, with the run's axis alone.
        pushes: The pushes about the run's axis.
        pose_times: Times of the recorded poses, (n_poses,) [s].
        qpos: Joint angles of the recorded poses, (n_poses, n_joints) [rad].
        ball: A ball that encloses the rig during the run.
        radius: Radius of the rig at its start, the scale of arrows and floors [m].
    """

    run: Run
    plant: Plant
    pushes: Sequence[Push]
    pose_times: np.ndarray
    qpos: np.ndarray
    ball: Ball
    radius: float


def make_branches(header: RecordingHeader, runs: Sequence[Run]) -> list[Branch]:
    """Make the branches of a recording, each named after its run.

    Raises:
        ValueError: There is no run, or two have the same name.
    """
    names = [run.name for run in runs]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"a recording needs runs of different names, not {names}")
    labels = short_names(names).values()
    places = zip(runs, numbered_parts(names), labels, strict=True)
    return [make_branch(header, run, f"/{part}", label) for run, part, label in places]


def make_branch(header: RecordingHeader, run: Run, path: str, label: str) -> Branch:
    """Make the branch of a run, as far as the run has come.

    Args:
        header: The experiment of the run.
        run: The run.
        path: Path of the branch.
        label: Shortened name of the run.

    Returns:
        The branch.
    """
    plant = header.plant_of(run.axis)
    times, qpos = _pose_samples(plant, run)
    return Branch(
        path=path,
        label=label,
        series={row.path: row for row in run_series(run, plant, header.settings, header.rate_limit_rad_s)},
        run=run,
        plant=plant,
        pushes=header.pushes_on(run.axis),
        pose_times=times,
        qpos=qpos,
        ball=enclosing_ball(plant, qpos),
        radius=enclosing_ball(plant, np.empty((0, plant.model.nq))).radius,
    )


def pose_stride(dt: float) -> int:
    """Return the number of ticks, dt [s] apart, from one recorded pose to the next."""
    return max(1, round(1.0 / (POSE_RATE_HZ * dt)))


def _pose_samples(plant: Plant, run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Choose the ticks at which poses are recorded; the initial pose, if the run has no tick."""
    trajectory = run.trajectory
    n = len(trajectory)
    if n == 0:
        return np.zeros(1), plant.new_data().qpos[None].copy()
    time = trajectory["time_s"]
    ticks = np.union1d(np.arange(0, n, pose_stride(time[1] - time[0]) if n > 1 else 1), n - 1)
    return time[ticks], trajectory.qpos()[ticks]
