"""Replays as a rerun recording: measurements, estimates and their errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from cmg_mj.core.types import BIAS
from cmg_mj.replay.log_replay import ReplayResult
from cmg_mj.replay.logs.log import REFERENCE
from cmg_mj.replay.report import replay_markdown, shown_first
from cmg_mj.results.stored_columns import LONG, STRETCH, select_rows, stretches
from cmg_mj.visualization.plots.colours import BASELINE_COLOURS, Colour, colours
from cmg_mj.visualization.plots.readability import short_names
from cmg_mj.visualization.plots.thinning import thinned
from cmg_mj.visualization.recording.legend import numbered_parts
from cmg_mj.visualization.recording.replay_recording import LogSeries, write_logs
from cmg_mj.visualization.recording.signals import CONTROLLER, MODULES, Series

FEW_DRAWN = 500
"""Number of samples that are left of a stretch of a long log where its outline is enough."""


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
        LogSeries(
            name, series(replayed), list(replayed.estimates), shown_first(replayed), partial(_stretches, replayed)
        )
        for name, replayed in zip(names, replays, strict=True)
    ]
    texts = {
        "Summary": f"# {title}\n\n{replay_markdown(replays)}\n",
        "Settings": f"# Settings\n\n```toml\n{settings_toml.strip()}\n```\n",
    }
    write_logs(path, title, logs, texts)


def series(replayed: ReplayResult) -> list[Series]:
    """Return all time series of one log: angles in degrees, rates in rad/s; of a long log, their outlines."""
    pieces = list(_outlines(replayed)) if len(replayed.log) > LONG else [list(_series(replayed, slice(None)))]
    rows = []
    for row in zip(*pieces, strict=True):
        time, values = (np.concatenate([getattr(piece, name) for piece in row]) for name in ("time", "values"))
        rows.append(replace(row[0], time=time, values=values))
    return rows


def _outlines(replayed: ReplayResult) -> Iterator[Sequence[Series]]:
    for rows in _stretches(replayed):
        thin = ((row, thinned(row.time, row.values, FEW_DRAWN)) for row in rows)
        yield [replace(row, time=time, values=values) for row, (time, values) in thin]


def _stretches(replayed: ReplayResult) -> Iterator[Sequence[Series]]:
    """Return the series of one log, stretch by stretch."""
    n_rows = len(replayed.log)
    for rows in stretches(n_rows, 2 * STRETCH if n_rows > LONG else n_rows):
        yield list(_series(replayed, rows))


def _series(replayed: ReplayResult, some: slice) -> Iterator[Series]:
    """Make the series of some rows, one by one."""
    log, columns = replayed.log, select_rows(replayed.log.columns, some)

    def row(
        path: str, name: str, values: np.ndarray, color: Colour, width: float = 1.5, whole: bool = True, by: str = ""
    ) -> Series:
        return Series(path, name, *log.broken(values, some), color, width, whole, by)

    yield row("tilt/measured", "measured", np.degrees(columns["y1_rad"]), BASELINE_COLOURS["gyro"])
    if "reference" in log.has:
        yield row("rate/true", "reference", columns[REFERENCE], BASELINE_COLOURS["true"], 3.0)
    labels, names = short_names(list(replayed.estimates)), list(replayed.estimates)
    for part, (name, color) in zip(numbered_parts(names), colours(names).items(), strict=True):
        estimates = select_rows(replayed.estimates[name], some)
        rate = estimates["x2_rad_s"]
        signals = {"rate_estimate": rate}
        if "reference" in log.has:
            signals["rate_error"] = rate - columns[REFERENCE]
        if BIAS in estimates:
            signals["bias"] = np.degrees(estimates[BIAS])
        for folder, values in signals.items():
            yield row(f"{folder}/{part}", labels[name], values, color, whole=False, by=name)
    if "acceleration" in log.has:
        measured = columns["acceleration_rad_s2"]
        yield row("acceleration/measured", "measured", measured, BASELINE_COLOURS["gyro"], 1.0, whole=False)
    if "gimbals" in log.has:
        yield row("command/u", "command", columns["u_rad_s"], CONTROLLER)
        yield row("gimbal/y2", "measured", np.degrees(columns["y2_rad"]), MODULES[0])
