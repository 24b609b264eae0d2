"""The files that `cmg-mj replay` writes: signals, plots, a recording and the figures."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cmg_mj.core.types import BIAS
from cmg_mj.features.replay.log import REFERENCE, Log
from cmg_mj.features.replay.log_replay import ReplayResult
from cmg_mj.features.replay.report import figure_text, log_figures, replay_figures, replay_markdown, shown_first
from cmg_mj.results.folder import RunFolder, write_text
from cmg_mj.results.summary_keys import finite
from cmg_mj.scenario.resolve import safe_name
from cmg_mj.view.plots.figure import Line, Panel, Picture, Span, draw
from cmg_mj.view.plots.run_plot import INK, MEASURED, SMALL_COLUMNS, limits
from cmg_mj.view.plots.style import BASELINE_COLOURS, colours, short_names, thinned

if TYPE_CHECKING:
    from cmg_mj.view.recording.signals import Series

DETAIL_S = 2.0
"""Length of the detail [s]."""
RISE_S = 0.1
"""Time over which the tilt rises, of whose differences the acceleration is seen [s]."""


def liveliest_span(log: Log) -> tuple[float, float]:
    """Return the ends of the span of `DETAIL_S` around the largest acceleration of the tilt [s]."""
    time, tilt = log.broken_time(), log.broken(log["y1_rad"])
    rise = max(1, min(round(RISE_S / log.dt), len(tilt) // 4))
    bends = np.nan_to_num(np.abs(np.diff(tilt[::rise], 2)))
    middle = time[rise * (int(np.argmax(bends)) + 1)]
    start, end = np.clip([middle - DETAIL_S / 2.0, middle + DETAIL_S / 2.0], time[0], time[-1]).tolist()
    return start, end


def plot_replay(path: Path, replayed: ReplayResult) -> None:
    """Draw one log on a page: tilt, rates and their errors, the liveliest seconds, and each other observer in these.

    Args:
        path: The PNG to write.
        replayed: The replay.
    """
    log, few, key = replayed.log, shown_first(replayed), "velocity_rms_error_rad_s"
    rates = {name: estimates["x2_rad_s"] for name, estimates in replayed.estimates.items()}
    labels = short_names(list(rates))
    reference = [log[REFERENCE]] if "reference" in log.has else []
    titles = dict(labels)
    for name in labels if reference else ():
        titles[name] += f" {figure_text(key, replayed.summaries[name].get(key))}"
    span, time = liveliest_span(log), log.broken_time()
    whole, detail = slice(None), slice(*np.searchsorted(time, span).tolist())

    def line(values: np.ndarray, label: str, color: str, width: float = 0.8, rows: slice = whole) -> Line:
        return Line(*thinned(time[rows], log.broken(values)[rows]), label, color=color, width=width)

    def rate_lines(names: Sequence[str], rows: slice) -> list[Line]:
        lines = [line(true, "reference", INK, 1.6, rows) for true in reference]
        return lines + [line(rates[name], labels[name], name, rows=rows) for name in names]

    y_range = limits([*reference, *(rates[name] for name in few)])
    shaded = [Span(*span, color="0.5")]
    panels = [
        Panel("tilt [deg]", [line(np.degrees(log["y1_rad"]), "measured", MEASURED)], shaded=shaded),
        Panel("tilt rate\n[rad/s]", rate_lines(few, whole), y_range=y_range, shaded=shaded),
    ]
    for true in reference:
        errors = [line(rates[name] - true, titles[name], name, 0.6) for name in few]
        errors.insert(0, Line([], [], "RMS:", " "))
        panels.append(Panel("estimate less\nreference [rad/s]", errors, shaded=shaded))
    x_label = f"time [s], {DETAIL_S:g} s in detail"
    panels.append(Panel("tilt rate\n[rad/s]", rate_lines(few, detail), x_label=x_label, y_range=y_range))
    n_first = len(panels)
    for name in rates:
        if name not in few:
            lines = [replace(line, label="") for line in rate_lines([name], detail)]
            panels.append(Panel("tilt rate [rad/s]", lines, titles[name], y_range=y_range))
    page = Picture("plot", log.title, panels, share_x=False, columns=SMALL_COLUMNS, n_first=n_first)
    draw(path, page)


def series(replayed: ReplayResult) -> list[Series]:
    """Make all time series of one log: angles in degrees, rates in rad/s."""
    from cmg_mj.view.recording.run import numbered_parts
    from cmg_mj.view.recording.signals import CONTROLLER, MODULES, Series

    log, gyro = replayed.log, BASELINE_COLOURS["gyro"]
    rows: list[tuple[Any, ...]] = [("tilt/measured", "measured", np.degrees(log["y1_rad"]), gyro)]
    if "reference" in log.has:
        rows.append(("rate/true", "reference", log[REFERENCE], BASELINE_COLOURS["true"], 3.0))
    labels, names = short_names(list(replayed.estimates)), list(replayed.estimates)
    for part, (name, color) in zip(numbered_parts(names), colours(names).items(), strict=True):
        estimates = replayed.estimates[name]
        signals = {"rate_estimate": estimates["x2_rad_s"]}
        if "reference" in log.has:
            signals["rate_error"] = estimates["x2_rad_s"] - log[REFERENCE]
        if BIAS in estimates:
            signals["bias"] = np.degrees(estimates[BIAS])
        rows += [(f"{folder}/{part}", labels[name], values, color, 1.5, name) for folder, values in signals.items()]
    if "acceleration" in log.has:
        rows.append(("acceleration/measured", "measured", log["acceleration_rad_s2"], gyro, 1.0))
    if "gimbals" in log.has:
        rows.append(("command/u", "command", log["u_rad_s"], CONTROLLER))
        rows.append(("gimbal/y2", "measured", np.degrees(log["y2_rad"]), MODULES[0]))
    time = log.broken_time()
    return [Series(path, name, time, log.broken(values), *style) for path, name, values, *style in rows]


def save_replays(
    folder: RunFolder, replays: Sequence[ReplayResult], names: Sequence[str], settings_toml: str, *, complete: bool
) -> Path:
    """Write summary.json, replay.toml, recording.rrd, and of every log its signals and plot, at once.

    Args:
        folder: The folder.
        replays: The replays.
        names: Names of all requested logs in the files, no two alike.
        settings_toml: The request, as TOML.
        complete: Whether all logs have been replayed.

    Returns:
        The folder of the files: see `RunFolder.write`.
    """
    from cmg_mj.view.recording.save import LogSeries, write_logs  # 0.4 s of import, needed only here

    named = dict(zip(names, replays, strict=False))
    title = f"Replay: {', '.join(named)}"
    logs = [LogSeries(name, series(replayed), shown_first(replayed)) for name, replayed in named.items()]
    texts = {
        "Summary": f"# {title}\n\n{replay_markdown(replays)}\n",
        "Settings": f"# Settings\n\n```toml\n{settings_toml.strip()}\n```\n",
    }
    files: dict[str, Callable[[Path], None]] = {
        "summary.json": lambda path: write_text(path, json.dumps(finite(replay_figures(replays)), indent=2)),
        "replay.toml": lambda path: write_text(path, settings_toml),
        "recording.rrd": lambda path: write_logs(path, title, logs, texts),
    }
    for name, replayed in named.items():
        suffix = f"-{name}" if len(named) > 1 else ""
        signals = replace(replayed.trajectory, metadata={"replay": finite(log_figures(replayed))})
        files[f"signals{suffix}.parquet"] = signals.save
        files[f"plot{suffix}.png"] = lambda path, replayed=replayed: plot_replay(path, replayed)
    return folder.write(files, complete=complete)


def distinct_names(names: Iterable[str]) -> list[str]:
    """Return logs' names as parts of file names, the repeated ones numbered."""
    distinct: dict[str, str] = {}
    for name in map(safe_name, names):
        numbered = (name if number == 1 else f"{name}-{number}" for number in count(1))
        candidate = next(candidate for candidate in numbered if candidate.casefold() not in distinct)
        distinct[candidate.casefold()] = candidate
    return list(distinct.values())
