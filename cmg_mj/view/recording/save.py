"""Writes finished runs as one rerun recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cmg_mj.view.recording.pages import log_pages
from cmg_mj.view.recording.run import RecordingHeader, Run
from cmg_mj.view.recording.scene import log_poses, log_pushes, log_shapes
from cmg_mj.view.recording.signals import log_phases, log_styles, log_values, make_branches
from cmg_mj.view.recording.stream import application_name, open_recording
from cmg_mj.view.recording.views import default_blueprint


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
    with open_recording(path, name, application, default_blueprint(branches)) as rec:
        end = max(run.outcome.time_s for run in runs)
        for branch in branches:
            log_shapes(rec, branch)
            log_pushes(rec, branch)
            log_styles(rec, branch)
            log_values(rec, branch)
            log_poses(rec, branch)
            log_phases(rec, header, branch, end)
        log_pages(rec, header, branches)
