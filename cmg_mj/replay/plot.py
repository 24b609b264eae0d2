"""The plot of a replay: tilt, estimated rates, their errors, and the liveliest seconds in detail."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.replay.log_replay import ReplayResult, describe_log
from cmg_mj.replay.logs.log import REFERENCE
from cmg_mj.replay.report import figure_text, shown_first
from cmg_mj.replay.scores import Figures
from cmg_mj.results.stored_columns import LONG, select_rows, stretches
from cmg_mj.visualization.plots.figure_spec import pyplot, save_figure
from cmg_mj.visualization.plots.run_plot import INK, MEASURED, PAGE, PANEL_HEIGHT, SMALL_COLUMNS, SMALL_HEIGHT
from cmg_mj.visualization.plots.style import colours, hexadecimal, short_names, thinned

if TYPE_CHECKING:
    from cmg_mj.visualization.plots.run_plot import Axes

DETAIL_S = 2.0
"""Length of the detail [s]."""


def liveliest_span(replayed: ReplayResult) -> tuple[float, float]:
    """Return the ends of the span in which the tilt accelerates most [s]."""
    log = replayed.log
    length = max(2, round(DETAIL_S / log.dt))
    liveliest, where = -1.0, (log["time_s"][0], log["time_s"][-1])
    for part in _overlapping(log.parts, length):
        stretch = select_rows(log.columns, part)
        time, tilt = stretch["time_s"], stretch["y1_rad"]
        rise = max(1, length // 20)
        bend = np.zeros(len(tilt))
        bend[rise:-rise] = (tilt[2 * rise :] - 2.0 * tilt[rise:-rise] + tilt[: -2 * rise]) ** 2
        sums = np.concatenate([[0.0], np.cumsum(bend)])
        n = min(length, len(tilt))
        lively = sums[n:] - sums[:-n]
        start = int(np.argmax(lively))
        if lively[start] > liveliest:
            liveliest = float(lively[start])
            middle = np.average(np.arange(n), weights=bend[start : start + n] + 1e-300)
            start = int(np.clip(start + middle - n / 2.0, 0, len(time) - n))
            where = float(time[start]), float(time[start + n - 1])
    return where


def _overlapping(parts: Sequence[slice], length: int) -> Iterator[slice]:
    """Divide long parts into stretches that share a span of so many samples, and its bends."""
    for part in parts:
        for rows in stretches(part.stop - part.start):
            yield slice(part.start + rows.start, min(part.stop, part.start + rows.stop + 2 * length))


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
    start, end = liveliest_span(replayed)
    _line(panels[0], replayed, np.degrees(log["y1_rad"]), None, color=MEASURED, linewidth=0.8, label="measured")
    panels[0].set_ylabel("tilt [deg]")
    for axes in (panels[1], panels[-1]):
        detail = (start, end) if axes is panels[-1] else None
        if referred:
            _line(axes, replayed, log[REFERENCE], detail, color=INK, linewidth=1.6, label="reference")
        for name in few:
            rate = replayed.estimates[name]["x2_rad_s"]
            _line(axes, replayed, rate, detail, color=palette[name], linewidth=0.8, label=labels[name].lstrip("_"))
            del rate
        axes.set_ylabel("tilt rate\n[rad/s]")
    if referred:
        panels[2].plot([], [], " ", label="RMS:")
        for name in few:
            text = f"{labels[name].lstrip('_')} {_rms(replayed.summaries[name])}"
            error = replayed.estimates[name]["x2_rad_s"] - log[REFERENCE]
            _line(panels[2], replayed, error, None, color=palette[name], linewidth=0.6, label=text)
            del error  # of a long log, a column takes much memory
        panels[2].set_ylabel("estimate less\nreference [rad/s]")
    rates = panels[1].get_ylim()
    panels[-1].set_xlim(start, end)
    panels[-1].set_ylim(*rates)
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
    save_figure(path, figure, describe_log(log), dpi=110)


def _line(
    axes: Axes,
    replayed: ReplayResult,
    values: np.ndarray,
    detail: tuple[float, float] | None,
    color: str,
    linewidth: float,
    label: str | None = None,
) -> None:
    """Draw a signal; of a long one, the outline, or all of it around the detail."""
    log = replayed.log
    if len(log) <= LONG:
        x, y = log.broken(values)
    elif detail is None:
        pieces = [thinned(*log.broken(values[rows], rows)) for rows in stretches(len(log))]
        x, y = (np.concatenate(part) for part in zip(*pieces, strict=True))
    else:
        first, last = np.searchsorted(log["time_s"], (detail[0] - DETAIL_S, detail[1] + DETAIL_S)).tolist()
        x, y = log.broken(values[first:last], slice(first, last))
    axes.plot(x, y, color=color, linewidth=linewidth, label=label)


def _draw_small(
    axes: Axes,
    replayed: ReplayResult,
    name: str,
    label: str,
    color: str,
    rates: tuple[float, float],
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
    axes.set_ylim(*rates)


def _rms(figures: Figures) -> str:
    key = "velocity_rms_error_rad_s"
    value = figures.get(key)
    return "" if value is None else figure_text(key, value)
