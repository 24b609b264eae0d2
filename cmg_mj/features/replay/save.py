"""Replay of several logs on request, as `cmg-mj replay` runs it, and the files that it writes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import tomli_w

from cmg_mj.core.errors import InputError
from cmg_mj.core.types import BIAS
from cmg_mj.features.replay.log import REFERENCE, Log, ReadOptions
from cmg_mj.features.replay.log_replay import ReplayResult, model_of, replay_prepared
from cmg_mj.features.replay.reading import check_distinct_logs, read_log
from cmg_mj.features.replay.report import figure_text, log_figures, replay_figures, replay_markdown, shown_first
from cmg_mj.observers.parameter_options import Parameters
from cmg_mj.results.folder import RunFolder, write_text
from cmg_mj.results.summary_keys import finite
from cmg_mj.scenario.resolve import safe_name
from cmg_mj.view.plots.figure import FIRST_HEIGHT, PAGE_WIDTH, SMALL_HEIGHT, pyplot, save_figure
from cmg_mj.view.plots.run_plot import INK, MEASURED, SMALL_COLUMNS
from cmg_mj.view.plots.style import BASELINE_COLOURS, Colour, colours, hexadecimal, short_names, thinned

if TYPE_CHECKING:
    from cmg_mj.view.plots.figure import Axes
    from cmg_mj.view.recording.signals import Series

DETAIL_S = 2.0
"""Length of the detail [s]."""


def liveliest_span(log: Log) -> tuple[float, float]:
    """Return the ends of the span of `DETAIL_S` in which the tilt accelerates most [s]."""
    length = max(2, round(DETAIL_S / log.dt))
    rise = max(1, length // 20)
    best, span = -1.0, (0.0, 0.0)
    for part in log.parts:
        time, tilt = log["time_s"][part], log["y1_rad"][part]
        bend = np.zeros(len(tilt))
        bend[rise:-rise] = (tilt[2 * rise :] - 2.0 * tilt[rise:-rise] + tilt[: -2 * rise]) ** 2
        sums = np.concatenate([[0.0], np.cumsum(bend)])
        n = min(length, len(tilt))
        start = int(np.argmax(sums[n:] - sums[:-n]))
        if sums[start + n] - sums[start] > best:
            best, span = sums[start + n] - sums[start], (float(time[start]), float(time[start + n - 1]))
    return span


def plot_replay(path: Path, replayed: ReplayResult) -> None:
    """Draw one log on a page: tilt, rates and their errors, the liveliest seconds, and each other observer in these.

    Args:
        path: The PNG to write.
        replayed: The replay.
    """
    log, few, key = replayed.log, shown_first(replayed), "velocity_rms_error_rad_s"
    rates = {name: estimates["x2_rad_s"] for name, estimates in replayed.estimates.items()}
    palette = {name: hexadecimal(rgb) for name, rgb in colours(rates).items()}
    labels = {name: label.lstrip("_") for name, label in short_names(list(rates)).items()}
    titles = {name: f"{label} {figure_text(key, replayed.summaries[name].get(key))}" for name, label in labels.items()}
    reference = [log[REFERENCE]] if "reference" in log.has else []
    others = [name for name in rates if name not in few]
    tall, rows = 3 + len(reference), -(-len(others) // SMALL_COLUMNS)
    heights = [FIRST_HEIGHT] * tall + [SMALL_HEIGHT] * rows
    figure = pyplot().figure(figsize=(PAGE_WIDTH, min(12.7, 0.8 + sum(heights))), layout="constrained")
    grid = figure.add_gridspec(len(heights), SMALL_COLUMNS, height_ratios=heights)
    panels = [figure.add_subplot(grid[i, :]) for i in range(tall)]
    small = [figure.add_subplot(grid[tall + i // SMALL_COLUMNS, i % SMALL_COLUMNS]) for i in range(len(others))]
    span, time = liveliest_span(log), log.broken_time()
    detail = slice(*np.searchsorted(time, span).tolist())

    def line(axes: Axes, values: np.ndarray, color: str, width: float, label: str | None = None) -> None:
        rows = slice(None) if axes in panels[:-1] else detail
        axes.plot(*thinned(time[rows], log.broken(values)[rows]), color=color, linewidth=width, label=label)

    line(panels[0], np.degrees(log["y1_rad"]), MEASURED, 0.8, "measured")
    panels[0].set_ylabel("tilt [deg]")
    for axes in (panels[1], panels[-1]):
        for values in reference:
            line(axes, values, INK, 1.6, "reference")
        for name in few:
            line(axes, rates[name], palette[name], 0.8, labels[name])
        axes.set_ylabel("tilt rate\n[rad/s]")
    for true in reference:
        panels[2].plot([], [], " ", label="RMS:")
        for name in few:
            line(panels[2], rates[name] - true, palette[name], 0.6, titles[name])
        panels[2].set_ylabel("estimate less\nreference [rad/s]")
    for axes in panels[:-1]:
        axes.axvspan(*span, color="0.5", alpha=0.15, linewidth=0, zorder=0)
        axes.set_xlim(log["time_s"][0], log["time_s"][-1])
    for axes, name in zip(small, others, strict=True):
        line(axes, rates[name], palette[name], 0.7)
        for values in reference:
            line(axes, values, INK, 0.8)
        title = titles[name] if reference else labels[name]
        axes.set_title(title, loc="left", fontsize="small", parse_math=False, pad=2.0)
        axes.tick_params(labelsize="small")
        axes.set_ylim(*panels[1].get_ylim())
    for axes in (panels[-1], *small):
        axes.set_xlim(*span)
    for axes in panels:
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize="small", ncols=6, frameon=False, borderpad=0)
    for axes in (*panels, *small):
        axes.grid(alpha=0.3)
    panels[-1].set_xlabel(f"time [s], {DETAIL_S:g} s in detail")
    figure.align_ylabels(panels)
    save_figure(path, figure, log.title, dpi=110)


def write_recording(path: Path, replays: Sequence[ReplayResult], names: Sequence[str], settings_toml: str) -> None:
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
    from cmg_mj.view.recording.save import LogSeries, write_logs  # 0.4 s of import, needed only here

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
    from cmg_mj.view.recording.run import numbered_parts
    from cmg_mj.view.recording.signals import CONTROLLER, MODULES, Series

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


@dataclass
class LogReplays:
    """Request to replay some logs, and the replays that are done. The logs are read at once.

    Attributes:
        paths: The logs' files.
        observers: Names of the observers.
        options: Options with which all logs are read.
        model: The pendulum as `model_of` takes it.
        noises: Noises from `noise_numbers`.
        parameters: Observer -> parameter -> value, where not the default.
        settle_s: Time at the start of each part that is not scored [s]; None for `replay_prepared`'s.
        logs: The logs.
        names: Their names in file names.
        results: The replays that are done.
    """

    paths: Sequence[str]
    observers: Sequence[str]
    options: ReadOptions
    model: str | None
    noises: Mapping[str, float]
    parameters: Parameters
    settle_s: float | None

    def __post_init__(self) -> None:
        for kind in self.parameters:
            if kind not in self.observers:
                raise InputError(f"--set {kind}: is not among --observers {','.join(self.observers)}")
        self._model = None if self.model is None else model_of(self.model)
        check_distinct_logs(self.paths)
        self.logs: list[Log] = [read_log(path, self.options) for path in self.paths]
        self.names = _distinct_names([log.name for log in self.logs])
        self.results: list[ReplayResult] = []

    def _as_toml(self) -> str:
        """Return the request as TOML."""
        parts = {
            "logs": list(self.paths),
            "log": self.options.as_toml(),
            "replay": {
                "observers": list(self.observers),
                "model": self.model,
                "parameters": self.parameters,
                "noise": self.noises,
                "settle_s": self.settle_s,
            },
        }
        parts["replay"] = {name: value for name, value in parts["replay"].items() if value not in (None, {})}
        return tomli_w.dumps({name: part for name, part in parts.items() if part})

    @property
    def complete(self) -> bool:
        """Return whether all logs have been replayed."""
        return len(self.results) == len(self.logs)

    @property
    def folder_name(self) -> str:
        """Name of the folder of the files by default."""
        return f"replay-{self.names[0]}" + (f"-and-{len(self.logs) - 1}-more" if len(self.logs) > 1 else "")

    def run(self, on_progress: Callable[[float, str], None]) -> None:
        """Replay the logs.

        Args:
            on_progress: Called with the logs done so far, parts of one included, and the current one's name. It may
                raise `KeyboardInterrupt`; the results until then are kept.
        """
        for i, log in enumerate(self.logs):
            self.results.append(
                replay_prepared(
                    log,
                    self.observers,
                    model=self._model,
                    noises=self.noises,
                    parameters=self.parameters,
                    settle_s=self.settle_s,
                    on_share=lambda share, i=i, log=log: on_progress(i + share, f"Replay {log.name}"),
                )
            )

    def save(self, folder: RunFolder) -> Path:
        """Write summary.json, replay.toml, recording.rrd, and of every log that is done its signals and plot, at once.

        Returns the folder of the files: see `RunFolder.write`.
        """
        names, toml = self.names[: len(self.results)], self._as_toml()
        files: dict[str, Callable[[Path], None]] = {
            "summary.json": lambda path: write_text(path, json.dumps(finite(replay_figures(self.results)), indent=2)),
            "replay.toml": lambda path: write_text(path, toml),
            "recording.rrd": lambda path: write_recording(path, self.results, names, toml),
        }
        for name, replayed in zip(names, self.results, strict=True):
            suffix = f"-{name}" if len(names) > 1 else ""
            signals = replace(replayed.trajectory, metadata={"replay": finite(log_figures(replayed))})
            files[f"signals{suffix}.parquet"] = signals.save
            files[f"plot{suffix}.png"] = lambda path, replayed=replayed: plot_replay(path, replayed)
        return folder.write(files, complete=self.complete)


def _distinct_names(names: Sequence[str]) -> list[str]:
    """Return logs' names as parts of file names, the repeated ones numbered."""
    distinct: list[str] = []
    for name in map(safe_name, names):
        number, candidate = 1, name
        while candidate.casefold() in [other.casefold() for other in distinct]:
            number += 1
            candidate = f"{name}-{number}"
        distinct.append(candidate)
    return distinct
