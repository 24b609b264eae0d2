"""Trajectory -> .rrd, to be looked at in rerun. No other part of the package imports rerun."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import rerun as rr

from cmg_mj.errors import InputError
from cmg_mj.legible import shortened
from cmg_mj.metrics import MetricsSettings
from cmg_mj.plant import Plant
from cmg_mj.push import Push
from cmg_mj.recording.blueprint import default_blueprint
from cmg_mj.recording.framing import Ball, ball
from cmg_mj.recording.run import Run
from cmg_mj.recording.scene import FLYWHEEL_SLOWDOWN, log_rig, pose_samples
from cmg_mj.recording.signals import Branch, Series, log_phases, log_series, numbered, series
from cmg_mj.recording.summary import observers_page, page, scenario_page
from cmg_mj.trajectory import whole_file

__all__ = ["Run", "write_recording"]

LONGEST_LIST = 120
"""Names of runs, put together, that still fit into an application's name [characters]."""


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
        Branch(f"/{part}", label, run, _series(run, plant, settings, rate_limit_rad_s), _around(run, plant))
        for part, label, run in zip(numbered(names), labels, runs, strict=True)
    ]
    notes = f"In the 3-D view the flywheels turn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed."
    with _strict(), rr.RecordingStream(_application(branches)) as rec:
        if not rr.is_enabled(rec):
            raise InputError("the environment variable RERUN turns recording off: unset it")
        # Rerun's own writing to a file hides a full disk, or waits for ever.
        memory = rec.memory_recording()
        try:
            rec.send_blueprint(default_blueprint(plant, branches), make_active=False, make_default=True)
            rec.set_log_time_enabled(False)
            rec.set_log_tick_enabled(False)
            rec.send_recording_name(f"{title or 'Run'}: {', '.join(labels)}")
            _log_properties(rec, runs, title)
            end = max(run.outcome.time_s for run in runs)
            for branch in branches:
                log_rig(rec, branch.path, plant, branch.run, pushes, branch.rig)
                log_series(rec, branch)
                log_phases(rec, branch, pushes, settings, end)
            _log_page(rec, "summary", page(title, runs, pushes, settings, notes))
            if observers := observers_page(runs):
                _log_page(rec, "observers", observers)
            _log_page(rec, "scenario", scenario_page(scenario_toml))
        finally:  # of what is left in it, rerun would complain on standard error
            content = memory.drain_as_bytes()
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def _series(run: Run, plant: Plant, settings: MetricsSettings, rate_limit: float | None) -> dict[str, Series]:
    return {row.path: row for row in series(run, plant, settings, rate_limit)}


def _around(run: Run, plant: Plant) -> Ball:
    return ball(plant, pose_samples(plant, run)[1])


def _application(branches: Sequence[Branch]) -> str:
    """The viewer remembers a layout by application: recordings with other branches or lines must not share it.

    It may have about 180 characters, of which few are punctuation.
    """
    listed = " ".join(branch.run.name for branch in branches)
    if len(listed) > LONGEST_LIST:
        listed = f"{len(branches)} runs"
    lines = " ".join(f"{branch.path}/{path}" for branch in branches for path in branch.series)
    return re.sub(r"[^\w -]", "-", f"cmg-mj {listed} {zlib.crc32(lines.encode()):08x}", flags=re.ASCII)


def _log_page(rec: rr.RecordingStream, path: str, page: str) -> None:
    rec.log(path, rr.TextDocument(page, media_type=rr.MediaType.MARKDOWN), static=True)


def _log_properties(rec: rr.RecordingStream, runs: Sequence[Run], title: str) -> None:
    """What a catalogue of recordings can be searched by."""
    experiment: dict[str, Any] = {name: version(name) for name in ("cmg_mj", "mujoco")}
    experiment |= {"title": title, "runs": [run.name for run in runs]}
    rec.send_property("experiment", rr.AnyValues(**experiment))
    for run in runs:
        numbers: dict[str, Any] = {key: value for key, value in run.summary.items() if isinstance(value, float)}
        numbers |= {"outcome": run.outcome.kind, "time_s": run.outcome.time_s}
        rec.send_property(rr.escape_entity_path_part(run.name), rr.AnyValues(**numbers))


@contextmanager
def _strict() -> Iterator[None]:
    """Let rerun raise where it would only warn."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)
