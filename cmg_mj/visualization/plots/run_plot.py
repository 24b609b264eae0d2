"""Draws figures from their data, and the one-page plot of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.results.files import whole_file
from cmg_mj.results.summary_keys import format_figure
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing
from cmg_mj.visualization.plots.colours import BOUND_COLOURS, colour, colours, hexadecimal
from cmg_mj.visualization.plots.figure_spec import Panel, Picture
from cmg_mj.visualization.plots.map_plot import draw_map, draw_surface, mappable
from cmg_mj.visualization.plots.readability import (
    RANKING_KEYS,
    Summary,
    axis_range,
    error_range,
    fall_start,
    figures_by_observer,
    is_seen,
    observers_to_draw,
    short_names,
    stretched,
)
from cmg_mj.visualization.plots.thinning import thinned

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


def pyplot() -> ModuleType:
    """Import matplotlib's pyplot, which then draws into files."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


def save_figure(path: Path, figure: Figure, title: str, dpi: int) -> None:
    """Give a figure its title, write it as PNG, and close it."""
    figure.suptitle(title, x=0.01, ha="left", parse_math=False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")
    pyplot().close(figure)


def draw(path: Path, picture: Picture) -> None:
    """Draw a figure.

    Args:
        path: The PNG to write.
        picture: The figure's data.
    """
    if picture.first_height is not None:
        figure = _with_large_first(picture, picture.first_height)
        save_figure(path, figure, picture.title, dpi=100)
        return
    columns = picture.columns
    rows = -(-len(picture.panels) // columns)
    size = (9.0 if columns == 1 else picture.panel_width * columns, 0.8 + picture.panel_height * rows)
    figure, grid = pyplot().subplots(
        rows, columns, sharex="col" if picture.share_x else False, figsize=size, layout="constrained", squeeze=False
    )
    for i, axes in enumerate(grid.flat):
        if i >= len(picture.panels):
            axes.set_visible(False)
            continue
        panel = picture.panels[i]
        _draw_panel(axes, panel)
        lowest = i + columns >= len(picture.panels)
        if lowest or not picture.share_x:
            axes.set_xlabel(panel.x_label)
            axes.tick_params(labelbottom=True)
    figure.align_ylabels()
    save_figure(path, figure, picture.title, dpi=100)


def _with_large_first(picture: Picture, first_height: float) -> Figure:
    """Draw the first panel over the whole width, and the others, small, in a grid below; surfaces share one scale."""
    first, others = picture.panels[0], picture.panels[1:]
    rows = -(-len(others) // picture.columns)
    heights = [first_height, *[picture.panel_height] * rows]
    size = (max(9.0, picture.panel_width * picture.columns), 0.8 + sum(heights))
    figure = pyplot().figure(figsize=size, layout="constrained")
    grid = figure.add_gridspec(len(heights), picture.columns, height_ratios=heights)
    axes = figure.add_subplot(grid[0, :])
    _draw_panel(axes, first)
    axes.set_xlabel(first.x_label)
    below: list[Axes] = []
    surface = None
    for i, panel in enumerate(others):
        row, column = divmod(i, picture.columns)
        axes = figure.add_subplot(grid[1 + row, column])
        _draw_panel(axes, panel)
        below.append(axes)
        surface = panel.surface or surface
        lowest = i + picture.columns >= len(others)
        axes.set_xlabel(panel.x_label if lowest else "", fontsize="small")
        axes.set_ylabel(panel.y_label.replace(" [", "\n[") if column == 0 else "", fontsize="x-small")
        axes.tick_params(labelbottom=lowest, labelleft=column == 0, labelsize="small")
    if surface is not None:
        bar = figure.colorbar(mappable(surface), ax=below, label=surface.label, location="bottom", aspect=60)
        ticks = sorted({*surface.levels, *([] if len(surface.levels) > 2 else surface.limits)})
        bar.set_ticks(ticks, labels=[f"{tick:.3g}" for tick in ticks])
        bar.minorticks_off()
    return figure


def _draw_panel(axes: Axes, panel: Panel) -> None:
    palette = colours(line.color for line in panel.lines if isinstance(line.color, str))
    for line in panel.lines:
        style = {"linewidth": line.width, "label": line.label or None}
        if line.color is not None:
            style["color"] = hexadecimal(palette[line.color]) if isinstance(line.color, str) else f"C{line.color}"
        (curve,) = axes.plot(line.x, line.y, line.style, markersize=4, **style)
        if line.spread is not None:
            below, above = np.broadcast_to(line.spread, (2, len(line.y)))
            low, high = np.subtract(line.y, below), np.add(line.y, above)
            if line.bars:
                axes.vlines(line.x, low, high, color=curve.get_color(), alpha=0.6, linewidth=line.width)
            else:
                axes.fill_between(line.x, low, high, color=curve.get_color(), alpha=0.2, linewidth=0)
    for start, end in panel.shaded:
        axes.axvspan(start, end, color="C3", alpha=0.25, linewidth=0, zorder=0)
    axes.set_xscale(panel.x_scale)
    axes.set_yscale(panel.y_scale)
    axes.set_ylabel(panel.y_label)
    axes.set_title(panel.title, loc="left", fontsize="medium")
    _mark(axes.xaxis, panel.x_ticks)
    _mark(axes.yaxis, panel.y_ticks)
    if panel.map is not None:
        draw_map(axes, panel.map)
        return
    if panel.surface is not None:
        draw_surface(axes, panel.surface)
        return
    axes.grid(alpha=0.3)
    marks_only = all(set(line.style) <= set("o.x+s") for line in panel.lines)
    axes.margins(x=0.0 if panel.x_scale == "linear" and not marks_only and panel.x_ticks is None else 0.03)
    if panel.y_range is not None:
        axes.set_ylim(*panel.y_range)
    if any(line.label for line in panel.lines):
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize="small", ncols=4, frameon=False, borderpad=0)


def _mark(axis: Axis, ticks: Sequence[float] | None) -> None:
    if ticks is not None:
        axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.set_ticks([], minor=True)


INK = "0.15"
"""Colour of true signals on paper."""
MEASURED = hexadecimal(colour("gyro"))
GYRO = "#a9c4ef"
"""Colour of the gyro's thin line, which lies on the wide true one."""
PUSH_COLOR, SWING_COLOR, SWING_HEIGHT = "C3", "C4", 0.05
"""Colours of pushes and swings, and the share of a panel's height that a swing's strip takes."""
PAGE = (9.0, 12.7)
"""Width and height of a page [inch]."""
PANEL_HEIGHT, SMALL_HEIGHT, SMALL_COLUMNS, SMALL_ROWS = 1.8, 1.3, 4, 3
"""Heights of the panels and of the small ones [inch], and the grid of the small ones, one an observer."""


def plot_run(
    path: Path,
    trajectory: Trajectory,
    title: str,
    summary: Summary,
    *,
    settle_band_deg: float,
    rate_limit_rad_s: float,
    pushes: Sequence[Push] = (),
    swings: Sequence[Swing] = (),
) -> None:
    """Plot a run on one page: tilt, tilt rate, error of the estimates, gimbal angle, command.

    The observer in the loop and the best open-loop observers share the panels. Each other observer has a small panel.

    Args:
        path: The PNG to write.
        trajectory: One world.
        title: Title above the plot.
        summary: The run's numbers, which rank the observers.
        settle_band_deg: Largest tilt of a settled rig [deg].
        rate_limit_rad_s: Largest command [rad/s].
        pushes: The pushes about the trajectory's axis.
        swings: The swings about the trajectory's axis.
    """
    summaries = figures_by_observer(trajectory.observers, summary)
    few = observers_to_draw(summaries, always=trajectory.observers[:1])
    labels = short_names(trajectory.observers)
    palette = {name: hexadecimal(rgb) for name, rgb in colours(trajectory.observers).items()}
    others = [name for name in trajectory.observers if name not in few]
    columns = max(SMALL_COLUMNS, -(-len(others) // SMALL_ROWS))
    small = [others[i : i + columns] for i in range(0, len(others), columns)]
    heights = [PANEL_HEIGHT] * 5 + [SMALL_HEIGHT] * len(small)
    figure = pyplot().figure(figsize=(PAGE[0], min(PAGE[1], 0.6 + sum(heights))), layout="constrained")
    grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    panels = [figure.add_subplot(grid[0, :])]
    panels += [figure.add_subplot(grid[i, :], sharex=panels[0]) for i in range(1, 5)]
    fell = bool(summary.get("fell"))
    before = trajectory["time_s"] <= fall_start(trajectory["time_s"], trajectory["x1_rad"], fell=fell)
    _draw_tilt(panels[0], trajectory, settle_band_deg, before)
    drawn = {name: palette[name] for name in few}
    rates = _draw_estimates(panels[1], panels[2], trajectory, drawn, labels, summaries, before)
    _draw_actuators(panels[3], panels[4], trajectory, rate_limit_rad_s, before)
    for i, row in enumerate(small, 5):
        for j, name in enumerate(row):
            axes = figure.add_subplot(grid[i, j], sharex=panels[0])
            _draw_small(axes, trajectory, name, labels[name], palette[name], rates)
            lowest = i == len(heights) - 1 or j >= len(small[-1])
            axes.tick_params(labelbottom=lowest, labelleft=j == 0, labelsize="small")
            if j == 0:
                axes.set_ylabel("tilt rate\n[rad/s]", fontsize="small")
            panels.append(axes)
    for axes in panels:
        axes.grid(alpha=0.3)
        axes.margins(x=0.0)
        _shade(axes, trajectory["time_s"], pushes, swings, label=axes is panels[0])
    for axes in panels[:5]:
        axes.tick_params(labelbottom=axes is panels[4])
        legend = {"fontsize": "small", "ncols": 7, "frameon": False, "borderpad": 0, "columnspacing": 1.4}
        handles, names = _seen(axes)
        axes.legend(handles, names, loc="lower right", bbox_to_anchor=(1.0, 1.0), **legend)
    panels[4].set_xlabel("time [s]")
    figure.align_ylabels(panels[:5])
    save_figure(path, figure, title, dpi=110)


def _shade(axes: Axes, time: np.ndarray, pushes: Sequence[Push], swings: Sequence[Swing], *, label: bool) -> None:
    """Shade pushes over the whole height; a swing, which may last, gets a strip at the foot."""
    start, end = (time[0], time[-1]) if len(time) else (0.0, 0.0)
    spans = [("push", PUSH_COLOR, 1.0, p.start_s, p.end_s) for p in pushes if p.torque_n_m]
    spans += [
        ("swing", SWING_COLOR, SWING_HEIGHT, s.start_s, end if s.duration_s is None else s.start_s + s.duration_s)
        for s in swings
    ]
    named: set[str] = set()
    for name, color, height, first, last in spans:
        if first >= end or last <= start:
            continue
        text = name if label and name not in named else None
        named.add(name)
        span = max(first, start), min(last, end)
        axes.axvspan(*span, ymax=height, color=color, alpha=0.25, linewidth=0, zorder=0, label=text)


def _seen(axes: Axes) -> tuple[list[Artist], list[str]]:
    """Select what a legend names: only lines of which a part is within the axes."""
    handles, names = axes.get_legend_handles_labels()
    lines = {id(line): np.asarray(line.get_ydata(), dtype=float) for line in axes.lines}
    limits = axes.get_ylim()
    kept = [
        (handle, name)
        for handle, name in zip(handles, names, strict=True)
        if id(handle) not in lines or not lines[id(handle)].size or is_seen(lines[id(handle)], limits)
    ]
    return [handle for handle, _ in kept], [name for _, name in kept]


def _draw_tilt(axes: Axes, trajectory: Trajectory, band: float, before: np.ndarray) -> None:
    t = trajectory["time_s"]
    measured, true = np.degrees(trajectory["y1_rad"]), np.degrees(trajectory["x1_rad"])
    axes.plot(*thinned(t, measured), color=MEASURED, linewidth=0.6, alpha=0.7, label="measured $y_1$")
    axes.plot(*thinned(t, true), color=INK, linewidth=1.3, label="true $x_1$ (from equilibrium)")
    _draw_bounds(axes, band, "settle band")
    axes.set_ylabel("tilt [deg]")
    fit(axes, [true[before]], [measured[before], np.array([band, -band])], [true[~before]])


def _draw_estimates(
    rates: Axes,
    errors: Axes,
    trajectory: Trajectory,
    palette: Mapping[str, str],
    labels: Mapping[str, str],
    summaries: Mapping[str, Summary],
    before: np.ndarray,
) -> tuple[float, float] | None:
    """Draw tilt rate and error of some observers; return the range of the rates.

    The ticks `before` a fall, (n,), decide about the ranges.
    """
    t, true = trajectory["time_s"], trajectory["x2_rad_s"]
    estimates = {name: trajectory[f"estimate/{name}/x2_rad_s"] for name in palette}
    rates.plot(*thinned(t, true), color=INK, linewidth=2.4, label="true $x_2$")
    rates.plot(*thinned(t, trajectory["fog_rad_s"]), color=GYRO, linewidth=0.6, label="gyro")
    ranking_key = next(
        (key for key in RANKING_KEYS if any(summaries[name].get(key) is not None for name in palette)), ""
    )
    if ranking_key:
        errors.plot([], [], " ", label="RMS in push windows:" if "push" in ranking_key else "RMS:")
    for name, color in palette.items():
        label = labels[name].lstrip("_")  # matplotlib hides what begins with an underscore
        style = {"color": color, "linewidth": 0.8}
        rms = summaries[name].get(ranking_key)
        rates.plot(*thinned(t, estimates[name]), **style, label=f"{label} $\\hat x_2$")
        errors.plot(
            *thinned(t, estimates[name] - true),
            **style,
            label=f"{label} {format_figure(ranking_key, rms)}" if ranking_key else label,
        )
    rates.set_ylabel("tilt rate\n[rad/s]")
    errors.set_ylabel("error $\\hat x_2 - x_2$\n[rad/s]")
    limits = error_range([true[before]], [(estimate - true)[before] for estimate in estimates.values()])
    if limits is not None:
        errors.set_ylim(*limits)
    return fit(rates, [true[before]], [estimate[before] for estimate in estimates.values()], [true[~before]])


def _draw_small(
    axes: Axes, trajectory: Trajectory, name: str, label: str, color: str, rates: tuple[float, float] | None
) -> None:
    """Draw one observer's estimate on the range of the others."""
    t = trajectory["time_s"]
    axes.plot(*thinned(t, trajectory[f"estimate/{name}/x2_rad_s"]), color=color, linewidth=0.5)
    axes.plot(*thinned(t, trajectory["x2_rad_s"]), color=INK, linewidth=0.8)
    axes.set_title(label, loc="left", fontsize="small", parse_math=False, pad=2.0)
    if rates is not None:
        axes.set_ylim(*rates)


def _draw_actuators(gimbal: Axes, command: Axes, trajectory: Trajectory, limit: float, before: np.ndarray) -> None:
    t, u = trajectory["time_s"], trajectory["u_rad_s"]
    gimbal.plot(*thinned(t, np.degrees(trajectory["x3_rad"])), color=INK, linewidth=1.3, label="true $x_3$")
    gimbal.set_ylabel("gimbal angle\n[deg]")
    command.step(*thinned(t, u), where="post", color=INK, linewidth=0.6, label="command $u$")
    _draw_bounds(command, limit, "rate limit")
    command.set_ylabel("gimbal rate\n[rad/s]")
    gimbal_deg = np.degrees(trajectory["x3_rad"])
    fit(gimbal, [gimbal_deg[before]], [], [gimbal_deg[~before]])
    fit(command, [u[before]], [np.array([limit, -limit])], [u[~before]])


def _draw_bounds(axes: Axes, bound: float, label: str) -> None:
    for value, name in ((bound, label), (-bound, None)):
        axes.axhline(value, color=hexadecimal(BOUND_COLOURS[label]), linewidth=1.0, linestyle="--", label=name)


def fit(
    axes: Axes,
    required: Sequence[np.ndarray],
    optional: Sequence[np.ndarray],
    fall: Sequence[np.ndarray] = (),
) -> tuple[float, float] | None:
    """Set the range of the ordinate by `axis_range`, stretched towards a fall, and return it."""
    limits = stretched(axis_range(required, optional), fall)
    if limits is not None:
        axes.set_ylim(*limits)
    return limits
