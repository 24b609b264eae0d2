"""The plot of a replay: tilt, estimated rates, their errors, and the liveliest seconds in detail."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.features.replay.log import REFERENCE, Log
from cmg_mj.features.replay.log_replay import ReplayResult
from cmg_mj.features.replay.report import figure_text, shown_first
from cmg_mj.features.replay.scores import Figures
from cmg_mj.view.plots.figure import pyplot, save_figure
from cmg_mj.view.plots.run_plot import INK, MEASURED, PAGE, PANEL_HEIGHT, SMALL_COLUMNS, SMALL_HEIGHT
from cmg_mj.view.plots.style import colours, hexadecimal, short_names, thinned

if TYPE_CHECKING:
    from cmg_mj.view.plots.figure import Axes

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
    log, few = replayed.log, shown_first(replayed)
    rates = {name: estimates["x2_rad_s"] for name, estimates in replayed.estimates.items()}
    palette = {name: hexadecimal(rgb) for name, rgb in colours(list(rates)).items()}
    labels = {name: label.lstrip("_") for name, label in short_names(list(rates)).items()}
    scores = {name: _rms(replayed.summaries[name]) for name in rates}
    reference = [log[REFERENCE]] if "reference" in log.has else []
    others = [name for name in rates if name not in few]
    tall, rows = 3 + len(reference), -(-len(others) // SMALL_COLUMNS)
    heights = [PANEL_HEIGHT] * tall + [SMALL_HEIGHT] * rows
    figure = pyplot().figure(figsize=(PAGE[0], min(PAGE[1], 0.8 + sum(heights))), layout="constrained")
    grid = figure.add_gridspec(len(heights), SMALL_COLUMNS, height_ratios=heights)
    panels = [figure.add_subplot(grid[i, :]) for i in range(tall)]
    span = liveliest_span(log)
    time = log.broken_time()
    detail = slice(*np.searchsorted(time, span).tolist())

    def line(axes: Axes, values: np.ndarray, color: str, width: float, label: str = "") -> None:
        rows = slice(None) if axes in panels[:-1] else detail
        x, y = thinned(time[rows], log.broken(values)[rows])
        axes.plot(x, y, color=color, linewidth=width, label=label or None)

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
            line(panels[2], rates[name] - true, palette[name], 0.6, f"{labels[name]} {scores[name]}")
        panels[2].set_ylabel("estimate less\nreference [rad/s]")
    for axes in panels[:-1]:
        axes.axvspan(*span, color="0.5", alpha=0.15, linewidth=0, zorder=0)
        axes.set_xlim(log["time_s"][0], log["time_s"][-1])
    small = [figure.add_subplot(grid[tall + i // SMALL_COLUMNS, i % SMALL_COLUMNS]) for i in range(len(others))]
    for axes, name in zip(small, others, strict=True):
        line(axes, rates[name], palette[name], 0.7)
        for values in reference:
            line(axes, values, INK, 0.8)
        axes.set_title(f"{labels[name]} {scores[name]}", loc="left", fontsize="small", parse_math=False, pad=2.0)
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


def _rms(figures: Figures) -> str:
    key = "velocity_rms_error_rad_s"
    value = figures.get(key)
    return "" if value is None else figure_text(key, value)
