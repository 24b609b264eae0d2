"""Replays as a rerun recording: measurements, estimates and their errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from cmg_mj.core.types import BIAS
from cmg_mj.features.replay.log import REFERENCE
from cmg_mj.features.replay.log_replay import ReplayResult
from cmg_mj.features.replay.report import replay_markdown, shown_first
from cmg_mj.view.plots.style import BASELINE_COLOURS, Colour, colours, short_names
from cmg_mj.view.recording.run import numbered_parts
from cmg_mj.view.recording.save import LogSeries, write_logs
from cmg_mj.view.recording.signals import CONTROLLER, MODULES, Series


def write_replay(path: Path, replays: Sequence[ReplayResult], names: Sequence[str], settings_toml: str) -> None:
    """Write the replays of some logs as one recording; whole or not at all.

    Args:
        path: The file, `recording.rrd`.
        replays: The replays; each has a branch of its own.
        names: Their names, no two alike.
        settings_toml: The request, as TOML.

    Raises:
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    title = f"Replay: {', '.join(names)}"
    logs = [
        LogSeries(name, list(series(replayed)), shown_first(replayed))
        for name, replayed in zip(names, replays, strict=True)
    ]
    texts = {
        "Summary": f"# {title}\n\n{replay_markdown(replays)}\n",
        "Settings": f"# Settings\n\n```toml\n{settings_toml.strip()}\n```\n",
    }
    write_logs(path, title, logs, texts)


def series(replayed: ReplayResult) -> Iterator[Series]:
    """Make all time series of one log, one by one: angles in degrees, rates in rad/s."""
    log = replayed.log
    time = log.broken_time()

    def row(path: str, name: str, values: np.ndarray, color: Colour, width: float = 1.5, by: str = "") -> Series:
        return Series(path, name, time, log.broken(values), color, width, by)

    yield row("tilt/measured", "measured", np.degrees(log["y1_rad"]), BASELINE_COLOURS["gyro"])
    if "reference" in log.has:
        yield row("rate/true", "reference", log[REFERENCE], BASELINE_COLOURS["true"], 3.0)
    labels, names = short_names(list(replayed.estimates)), list(replayed.estimates)
    for part, (name, color) in zip(numbered_parts(names), colours(names).items(), strict=True):
        estimates = replayed.estimates[name]
        rate = estimates["x2_rad_s"]
        signals = {"rate_estimate": rate}
        if "reference" in log.has:
            signals["rate_error"] = rate - log[REFERENCE]
        if BIAS in estimates:
            signals["bias"] = np.degrees(estimates[BIAS])
        for folder, values in signals.items():
            yield row(f"{folder}/{part}", labels[name], values, color, by=name)
    if "acceleration" in log.has:
        measured = log["acceleration_rad_s2"]
        yield row("acceleration/measured", "measured", measured, BASELINE_COLOURS["gyro"], 1.0)
    if "gimbals" in log.has:
        yield row("command/u", "command", log["u_rad_s"], CONTROLLER)
        yield row("gimbal/y2", "measured", np.degrees(log["y2_rad"]), MODULES[0])
