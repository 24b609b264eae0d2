"""A run with all that its branch of a recording shows, computed once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmg_mj.plant.plant import Plant
from cmg_mj.results.trajectory import STRETCH
from cmg_mj.stages.push import Push
from cmg_mj.visualization.plots.readability import fall_start
from cmg_mj.visualization.recording.camera import POSES, Ball, enclosing_ball
from cmg_mj.visualization.recording.legend import LegendEntry, legend
from cmg_mj.visualization.recording.run import RecordingHeader, Run, pose_ticks, poses_at
from cmg_mj.visualization.recording.signals import Lines, run_series


@dataclass(frozen=True, kw_only=True)
class Branch(Lines):
    """A run and its place in the recording.

    Attributes:
        run: The run.
        entry: The run in the legends.
        observers: The run's observers in the legends.
        plant: The plant; of several axes, with the run's axis alone.
        pushes: The pushes about the run's axis.
        pose_ticks: Ticks of the recorded poses, (n_poses,); none of a run without ticks.
        ball: A ball that encloses the rig during the run.
        radius: Radius of the rig at its start, the scale of arrows and floors [m].
    """

    run: Run
    entry: LegendEntry
    observers: Sequence[LegendEntry]
    plant: Plant
    pushes: Sequence[Push]
    pose_ticks: np.ndarray
    ball: Ball
    radius: float


def make_branches(header: RecordingHeader, runs: Sequence[Run]) -> list[Branch]:
    """Make the branches of a recording, each named after its run, as far as the runs have come.

    Raises:
        ValueError: There is no run, or two have the same name.
    """
    names = [run.name for run in runs]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"a recording needs runs of different names, not {names}")
    entries = legend({run.name: run.ranking for run in runs})
    return [_make_branch(header, run, entry) for run, entry in zip(runs, entries, strict=True)]


def _make_branch(header: RecordingHeader, run: Run, entry: LegendEntry) -> Branch:
    plant = header.plant if run.axis is None else header.plant.single_axis(run.axis)
    ticks = pose_ticks(run.trajectory)
    _, qpos = poses_at(plant, run.trajectory, _few(ticks))
    observers = legend(run.observers, always=run.trajectory.observers[:1])
    series = run_series(run, plant, observers, header.settings, header.rate_limit_rad_s, thin=True)
    return Branch(
        path=f"/{entry.part}",
        label=entry.label,
        series={row.path: row for row in series},
        run=run,
        entry=entry,
        observers=observers,
        plant=plant,
        pushes=[push for push in header.pushes if run.axis is None or push.axis == run.axis],
        pose_ticks=ticks,
        ball=enclosing_ball(plant, qpos),
        falls_from=fall_start(run.trajectory["time_s"], run.trajectory["x1_rad"], fell=run.outcome.kind == "fell"),
        radius=enclosing_ball(plant, np.empty((0, plant.model.nq))).radius,
    )


def _few(ticks: np.ndarray) -> np.ndarray:
    """Select the ticks of a long run whose poses suffice to enclose the rig."""
    return ticks if len(ticks) <= STRETCH else ticks[np.linspace(0, len(ticks) - 1, POSES).astype(int)]
