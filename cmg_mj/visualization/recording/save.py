"""Writes finished runs as one rerun recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.disturbances import Push
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.visualization.plots.readability import short_names
from cmg_mj.visualization.recording.blueprint import default_blueprint
from cmg_mj.visualization.recording.camera import enclosing_ball
from cmg_mj.visualization.recording.run import Run
from cmg_mj.visualization.recording.scene import log_rig, pose_samples
from cmg_mj.visualization.recording.signals import (
    Branch,
    log_lane,
    log_phases,
    log_series,
    numbered_parts,
    phase_steps,
    run_series,
)
from cmg_mj.visualization.recording.stream import application_name, recorded
from cmg_mj.visualization.recording.summary import log_results, log_scenario


def write_recording(
    path: Path,
    plant: Plant,
    runs: Sequence[Run],
    *,
    title: str = "",
    pushes: Sequence[Push] = (),
    settings: MetricsSettings | None = None,
    rate_limit_rad_s: float | None = None,
    scenario_toml: str = "",
) -> None:
    """Write one run, or several runs to compare, as a rerun recording; whole or not at all.

    Args:
        path: The file, `recording.rrd`.
        plant: The plant of all runs.
        runs: The runs; each has a branch, named after the run.
        title: The experiment's title.
        pushes: Torques from outside, the same in all runs.
        settings: The settle band.
        rate_limit_rad_s: Largest gimbal rate; None to leave its bounds away [rad/s].
        scenario_toml: The resolved scenario.

    Raises:
        ValueError: There is no run, or two have the same name.
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    names = [run.name for run in runs]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"a recording needs runs of different names, not {names}")
    settings = settings or MetricsSettings()
    labels = short_names(names).values()
    plants = [plant if run.axis is None else plant.single_axis(run.axis) for run in runs]
    branches = [
        Branch(
            path=f"/{part}",
            label=label,
            series={row.path: row for row in run_series(run, run_plant, settings, rate_limit_rad_s)},
            run=run,
            ball=enclosing_ball(run_plant, pose_samples(run_plant, run)[1]),
        )
        for part, label, run, run_plant in zip(numbered_parts(names), labels, runs, plants, strict=True)
    ]
    title_line = f"{title or 'Run'}: {', '.join(labels)}"
    with recorded(path, title_line, application_name(names, branches), default_blueprint(plant, branches)) as rec:
        end = max(run.outcome.time_s for run in runs)
        for branch, run_plant in zip(branches, plants, strict=True):
            run_pushes = branch.run.pushes_on_axis(pushes)
            log_rig(rec, branch.path, run_plant, branch.run, run_pushes)
            log_series(rec, branch)
            log_lane(rec, branch.path)
            log_phases(rec, branch.path, phase_steps(branch.run, run_pushes, settings, end))
        log_results(rec, runs, title, pushes, settings)
        log_scenario(rec, scenario_toml)
