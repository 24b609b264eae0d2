"""Writes finished runs as one rerun recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import rerun as rr

from cmg_mj.visualization.recording.blueprint import default_blueprint
from cmg_mj.visualization.recording.branch import Branch, make_branches
from cmg_mj.visualization.recording.run import RecordingHeader, Run, poses_at
from cmg_mj.visualization.recording.scene import log_poses, log_rig
from cmg_mj.visualization.recording.signals import (
    Lines,
    log_lane,
    log_phases,
    log_styles,
    log_values,
    phase_steps,
    run_series,
)
from cmg_mj.visualization.recording.stream import application_name, open_recording
from cmg_mj.visualization.recording.summary import log_results, log_scenario


def write_recording(path: Path, header: RecordingHeader, runs: Sequence[Run]) -> None:
    """Write one run, or several runs to compare, as a rerun recording; whole or not at all.

    Args:
        path: The file, `recording.rrd`.
        header: The experiment of all runs.
        runs: The runs; each has a branch, named after the run.

    Raises:
        ValueError: There is no run, or two have the same name.
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    branches = make_branches(header, runs)
    name = f"{header.title or 'Run'}: {', '.join(branch.label for branch in branches)}"
    application = application_name([run.name for run in runs], branches)
    with open_recording(path, name, application, default_blueprint(header.plant, branches)) as rec:
        end = max(run.outcome.time_s for run in runs)
        for branch in branches:
            log_rig(rec, branch)
            log_styles(rec, branch)
            _log_ticks(rec, header, branch)
            log_lane(rec, branch.path)
            log_phases(rec, branch.path, phase_steps(branch.run, branch.pushes, header.settings, end))
        log_results(rec, header, branches)
        log_scenario(rec, header.scenario_toml)


def _log_ticks(rec: rr.RecordingStream, header: RecordingHeader, branch: Branch) -> None:
    """Record series and poses, a stretch after the other."""
    ticks, trajectory = branch.pose_ticks, branch.run.trajectory
    stretches = list(trajectory.stretches())
    for rows in stretches:
        lines: Lines = branch
        stretch = trajectory.rows(rows)
        if len(stretches) > 1:
            run = replace(branch.run, trajectory=stretch)
            series = run_series(run, branch.plant, branch.observers, header.settings, header.rate_limit_rad_s)
            lines = Lines(path=branch.path, label=branch.label, series={row.path: row for row in series})
        log_values(rec, lines)
        inside = ticks[(ticks >= rows.start) & (ticks < rows.stop)] - rows.start
        if len(inside) or not len(trajectory):
            log_poses(rec, branch.path, branch.plant, *poses_at(branch.plant, stretch, inside))
        rec.flush()
