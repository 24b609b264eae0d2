"""What a recording says besides its signals: pages of text, and what a catalogue finds it by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun as rr

from cmg_mj.scenario.disturbances import Push
from cmg_mj.scenario.resolve import versions
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.visualization.recording.run import Run
from cmg_mj.visualization.recording.scene import FLYWHEEL_SLOWDOWN
from cmg_mj.visualization.recording.stream import log_page
from cmg_mj.visualization.recording.summary import observers_page, page, scenario_page

NOTES = f"In the 3-D view the flywheels turn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed."


def log_results(
    rec: rr.RecordingStream, runs: Sequence[Run], title: str, pushes: Sequence[Push], settings: MetricsSettings
) -> None:
    """Record what is known of runs that have ended.

    Args:
        rec: The recording.
        runs: The runs.
        title: The experiment's title.
        pushes: Torques from outside.
        settings: What counts as settled.
    """
    experiment: dict[str, Any] = {name: versions()[name] for name in ("cmg_mj", "mujoco")}
    experiment |= {"title": title, "runs": [run.name for run in runs]}
    rec.send_property("experiment", rr.AnyValues(**experiment))
    for run in runs:
        numbers: dict[str, Any] = {key: value for key, value in run.summary.items() if isinstance(value, float)}
        numbers |= {"outcome": run.outcome.kind, "time_s": run.outcome.time_s}
        rec.send_property(rr.escape_entity_path_part(run.name), rr.AnyValues(**numbers))
    log_page(rec, "summary", page(title, runs, pushes, settings, NOTES))
    if observers := observers_page(runs):
        log_page(rec, "observers", observers)


def log_scenario(rec: rr.RecordingStream, toml: str) -> None:
    """The page with the resolved scenario."""
    log_page(rec, "scenario", scenario_page(toml))
