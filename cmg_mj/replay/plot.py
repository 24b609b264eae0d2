"""The plot of a replay: tilt, estimated rates, their errors, and the liveliest seconds in detail."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.replay.log import REFERENCE, Log
from cmg_mj.replay.log_replay import ReplayResult
from cmg_mj.replay.report import figure_text, shown_first
from cmg_mj.replay.scores import Figures
from cmg_mj.visualization.plots.colours import colours, hexadecimal
from cmg_mj.visualization.plots.readability import short_names
from cmg_mj.visualization.plots.run_plot import (
    INK,
    MEASURED,
    PAGE,
    PANEL_HEIGHT,
    SMALL_COLUMNS,
    SMALL_HEIGHT,
    fit,
    pyplot,
    save_figure,
)
from cmg_mj.visualization.plots.thinning import thinned

if TYPE_CHECKING:
    from cmg_mj.visualization.plots.run_plot import Axes

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
    """Draw one log on a page.

    Args:
        path: The PNG to write.
        replayed: The replay.
    """
    log, names = replayed.log, list(replayed.estimates)
    few, referred = shown_first(replayed), "reference" in log.has
    others = [name for name in names if name not in few]
    palette = {name: hexadecimal(rgb) for name, rgb in colours(names).items()}
    labels = short_names(names)
    small = [others[i : i + SMALL_COLUMNS] for i in range(0, len(others), SMALL_COLUMNS)]
    tall = 4 if referred else 3
    heights = [PANEL_HEIGHT] * tall + [SMALL_HEIGHT] * len(small)
    figure = pyplot().figure(figsize=(PAGE[0], min(PAGE[1], 0.8 + sum(heights))), layout="constrained")
    grid = figure.add_gridspec(len(heights), SMALL_COLUMNS, height_ratios=heights)
    panels = [figure.add_subplot(grid[i, :]) for i in range(tall)]
    start, end = liveliest_span(log)
    _line(panels[0], replayed, np.degrees(log["y1_rad"]), None, color=MEASURED, linewidth=0.8, label="measured")
    panels[0].set_ylabel("tilt [deg]")
    rates = None
    for axes in (panels[1], panels[-1]):
        detail = (start, end) if axes is panels[-1] else None
        if referred:
            _line(axes, replayed, log[REFERENCE], detail, color=INK, linewidth=1.6, label="reference")
        for name in few:
            rate, label = replayed.estimates[name]["x2_rad_s"], labels[name].lstrip("_")
            _line(axes, replayed, rate, detail, color=palette[name], linewidth=0.8, label=label)
        axes.set_ylabel("tilt rate\n[rad/s]")
        estimates = [replayed.estimates[name]["x2_rad_s"] for name in few]
        rates = fit(axes, [log[REFERENCE]] if referred else [], estimates)
    if referred:
        errors = {name: replayed.estimates[name]["x2_rad_s"] - log[REFERENCE] for name in few}
        panels[2].plot([], [], " ", label="RMS:")
        for name in few:
            text = f"{labels[name].lstrip('_')} {_rms(replayed.summaries[name])}"
            _line(panels[2], replayed, errors[name], None, color=palette[name], linewidth=0.6, label=text)
        panels[2].set_ylabel("estimate less\nreference [rad/s]")
        fit(panels[2], [log[REFERENCE]], list(errors.values()))
    panels[-1].set_xlim(start, end)
    for axes in panels[:-1]:
        axes.axvspan(start, end, color="0.5", alpha=0.15, linewidth=0, zorder=0)
        axes.set_xlim(log["time_s"][0], log["time_s"][-1])
    for i, row in enumerate(small, tall):
        for j, name in enumerate(row):
            axes = figure.add_subplot(grid[i, j])
            _draw_small(axes, replayed, name, labels[name], palette[name], rates, (start, end))
            axes.tick_params(labelleft=j == 0, labelsize="small")
    for axes in panels:
        axes.grid(alpha=0.3)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize="small", ncols=6, frameon=False, borderpad=0)
    panels[-1].set_xlabel(f"time [s], {DETAIL_S:g} s in detail" if end - start < log.duration_s else "time [s]")
    figure.align_ylabels(panels)
    save_figure(path, figure, log.title, dpi=110)


def _line(
    axes: Axes,
    replayed: ReplayResult,
    values: np.ndarray,
    detail: tuple[float, float] | None,
    color: str,
    linewidth: float,
    label: str | None = None,
) -> None:
    """Draw the outline of a signal, or all of it around the detail."""
    time, values = replayed.log.broken(values)
    if detail is None:
        time, values = thinned(time, values)
    else:
        rows = slice(*np.searchsorted(time, (detail[0] - DETAIL_S, detail[1] + DETAIL_S)))
        time, values = time[rows], values[rows]
    axes.plot(time, values, color=color, linewidth=linewidth, label=label)


def _draw_small(
    axes: Axes,
    replayed: ReplayResult,
    name: str,
    label: str,
    color: str,
    rates: tuple[float, float] | None,
    span: tuple[float, float],
) -> None:
    """Draw another observer in detail, on the axis of the few."""
    _line(axes, replayed, replayed.estimates[name]["x2_rad_s"], span, color=color, linewidth=0.7)
    if "reference" in replayed.log.has:
        _line(axes, replayed, replayed.log[REFERENCE], span, color=INK, linewidth=0.8)
    text = f"{label} {_rms(replayed.summaries[name])}".strip()
    axes.set_title(text, loc="left", fontsize="small", parse_math=False, pad=2.0)
    axes.set_xlim(*span)
    axes.grid(alpha=0.3)
    if rates is not None:
        axes.set_ylim(*rates)


def _rms(figures: Figures) -> str:
    key = "velocity_rms_error_rad_s"
    value = figures.get(key)
    return "" if value is None else figure_text(key, value)
