"""Trajectory -> .rrd, to be looked at in rerun. No other part of the package imports rerun."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import rerun as rr

from cmg_mj.legible import shortened
from cmg_mj.metrics import MetricsSettings
from cmg_mj.plant import Plant
from cmg_mj.push import Push
from cmg_mj.recording.blueprint import default_blueprint
from cmg_mj.recording.framing import Ball, ball
from cmg_mj.recording.run import Run
from cmg_mj.recording.scene import FLYWHEEL_SLOWDOWN, log_rig, pose_samples
from cmg_mj.recording.signals import Branch, Series, log_phases, log_series, numbered, series
from cmg_mj.recording.stream import application_of, log_page, recorded
from cmg_mj.recording.summary import observers_page, page, scenario_page

__all__ = ["Run", "write_recording"]


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
    """Write one run, or several to be compared, as a rerun recording; whole or not at all.

    Args:
        path: The file, `recording.rrd`.
        plant: The rig of all runs.
        runs: The runs; each has a branch of its own, by its name.
        title: The experiment's title.
        pushes: Torques from outside, the same in all runs.
        settings: What counts as settled.
        rate_limit_rad_s: Largest gimbal rate, if it is to be shown [rad/s].
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
    labels = shortened(names).values()
    branches = [
        Branch(
            path=f"/{part}",
            label=label,
            series=_series(run, plant, settings, rate_limit_rad_s),
            run=run,
            rig=_around(run, plant),
        )
        for part, label, run in zip(numbered(names), labels, runs, strict=True)
    ]
    notes = f"In the 3-D view the flywheels turn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed."
    title_line = f"{title or 'Run'}: {', '.join(labels)}"
    with recorded(path, title_line, application_of(names, branches), default_blueprint(plant, branches)) as rec:
        _log_properties(rec, runs, title)
        end = max(run.outcome.time_s for run in runs)
        for branch in branches:
            log_rig(rec, branch.path, plant, branch.run, pushes, branch.rig)
            log_series(rec, branch)
            log_phases(rec, branch, pushes, settings, end)
        log_page(rec, "summary", page(title, runs, pushes, settings, notes))
        if observers := observers_page(runs):
            log_page(rec, "observers", observers)
        log_page(rec, "scenario", scenario_page(scenario_toml))


def _series(run: Run, plant: Plant, settings: MetricsSettings, rate_limit: float | None) -> dict[str, Series]:
    return {row.path: row for row in series(run, plant, settings, rate_limit)}


def _around(run: Run, plant: Plant) -> Ball:
    return ball(plant, pose_samples(plant, run)[1])


def _log_properties(rec: rr.RecordingStream, runs: Sequence[Run], title: str) -> None:
    """What a catalogue of recordings can be searched by."""
    experiment: dict[str, Any] = {name: version(name) for name in ("cmg_mj", "mujoco")}
    experiment |= {"title": title, "runs": [run.name for run in runs]}
    rec.send_property("experiment", rr.AnyValues(**experiment))
    for run in runs:
        numbers: dict[str, Any] = {key: value for key, value in run.summary.items() if isinstance(value, float)}
        numbers |= {"outcome": run.outcome.kind, "time_s": run.outcome.time_s}
        rec.send_property(rr.escape_entity_path_part(run.name), rr.AnyValues(**numbers))
