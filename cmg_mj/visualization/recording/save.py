"""Writes finished runs as one rerun recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cmg_mj.visualization.recording.blueprint import default_blueprint
from cmg_mj.visualization.recording.branch import make_branches
from cmg_mj.visualization.recording.run import RecordingHeader, Run
from cmg_mj.visualization.recording.scene import log_rig
from cmg_mj.visualization.recording.signals import log_lane, log_phases, log_series, phase_steps
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
            log_series(rec, branch)
            log_lane(rec, branch.path)
            log_phases(rec, branch.path, phase_steps(branch.run, branch.pushes, header.settings, end))
        log_results(rec, header, branches)
        log_scenario(rec, header.scenario_toml)
