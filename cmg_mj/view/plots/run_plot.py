"""The one-page plot of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cmg_mj.results.summary_keys import format_figure
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing
from cmg_mj.view.plots.figure import pyplot, save_figure
from cmg_mj.view.plots.style import (
    BOUND_COLOURS,
    RANKING_KEYS,
    Summary,
    colour,
    colours,
    figures_by_observer,
    hexadecimal,
    observers_to_draw,
    short_names,
    thinned,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    rows = -(-len(others) // columns)
    heights = [PANEL_HEIGHT] * 5 + [SMALL_HEIGHT] * rows
    figure = pyplot().figure(figsize=(PAGE[0], min(PAGE[1], 0.6 + sum(heights))), layout="constrained")
    grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    panels = [figure.add_subplot(grid[0, :])]
    panels += [figure.add_subplot(grid[i, :], sharex=panels[0]) for i in range(1, 5)]
    panels[2].sharey(panels[1])  # a scale of their own would make small errors look large
    _draw_tilt(panels[0], trajectory, settle_band_deg)
    _draw_estimates(panels[1], panels[2], trajectory, {name: palette[name] for name in few}, labels, summaries)
    _draw_actuators(panels[3], panels[4], trajectory, rate_limit_rad_s)
    rates = panels[1].get_ylim()
    for i, name in enumerate(others):
        row, column = divmod(i, columns)
        axes = figure.add_subplot(grid[5 + row, column], sharex=panels[0])
        _draw(axes, trajectory, f"estimate/{name}/x2_rad_s", color=palette[name], linewidth=0.5)
        _draw(axes, trajectory, "x2_rad_s", color=INK, linewidth=0.8)
        axes.set_title(labels[name], loc="left", fontsize="small", parse_math=False, pad=2.0)
        axes.set_ylim(*rates)
        axes.tick_params(labelbottom=i + columns >= len(others), labelleft=column == 0, labelsize="small")
        axes.set_ylabel("tilt rate\n[rad/s]" if column == 0 else "", fontsize="small")
        panels.append(axes)
    for axes in panels:
        axes.grid(alpha=0.3)
        axes.margins(x=0.0)
        _shade(axes, trajectory["time_s"], pushes, swings, label=axes is panels[0])
    for axes in panels[:5]:
        axes.tick_params(labelbottom=axes is panels[4])
        legend = {"fontsize": "small", "ncols": 7, "frameon": False, "borderpad": 0, "columnspacing": 1.4}
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), **legend)
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


def _draw(axes: Axes, trajectory: Trajectory, signal: str, scale: float = 1.0, **style: Any) -> None:
    axes.plot(*thinned(trajectory["time_s"], scale * trajectory[signal]), **style)


def _draw_tilt(axes: Axes, trajectory: Trajectory, band: float) -> None:
    degree = np.degrees(1.0)
    _draw(axes, trajectory, "y1_rad", degree, color=MEASURED, linewidth=0.6, alpha=0.7, label="measured $y_1$")
    _draw(axes, trajectory, "x1_rad", degree, color=INK, linewidth=1.3, label="true $x_1$ (from equilibrium)")
    _draw_bounds(axes, band, "settle band")
    axes.set_ylabel("tilt [deg]")


def _draw_estimates(
    rates: Axes,
    errors: Axes,
    trajectory: Trajectory,
    palette: Mapping[str, str],
    labels: Mapping[str, str],
    summaries: Mapping[str, Summary],
) -> None:
    """Draw tilt rate and error of some observers."""
    t, true = trajectory["time_s"], trajectory["x2_rad_s"]
    _draw(rates, trajectory, "x2_rad_s", color=INK, linewidth=2.4, label="true $x_2$")
    _draw(rates, trajectory, "fog_rad_s", color=GYRO, linewidth=0.6, label="gyro")
    key = next((key for key in RANKING_KEYS if any(summaries[name].get(key) is not None for name in palette)), "")
    if key:
        errors.plot([], [], " ", label="RMS in push windows:" if "push" in key else "RMS:")
    for name, color in palette.items():
        label = labels[name].lstrip("_")  # matplotlib hides what begins with an underscore
        estimate = trajectory[f"estimate/{name}/x2_rad_s"]
        rms = f" {format_figure(key, summaries[name].get(key))}" if key else ""
        style = {"color": color, "linewidth": 0.8}
        rates.plot(*thinned(t, estimate), label=f"{label} $\\hat x_2$", **style)
        errors.plot(*thinned(t, estimate - true), label=label + rms, **style)
    rates.set_ylabel("tilt rate\n[rad/s]")
    errors.set_ylabel("error $\\hat x_2 - x_2$\n[rad/s]")


def _draw_actuators(gimbal: Axes, command: Axes, trajectory: Trajectory, limit: float) -> None:
    _draw(gimbal, trajectory, "x3_rad", np.degrees(1.0), color=INK, linewidth=1.3, label="true $x_3$")
    gimbal.set_ylabel("gimbal angle\n[deg]")
    style = {"color": INK, "linewidth": 0.6, "drawstyle": "steps-post"}
    _draw(command, trajectory, "u_rad_s", label="command $u$", **style)
    _draw_bounds(command, limit, "rate limit")
    command.set_ylabel("gimbal rate\n[rad/s]")


def _draw_bounds(axes: Axes, bound: float, label: str) -> None:
    for value, name in ((bound, label), (-bound, None)):
        axes.axhline(value, color=hexadecimal(BOUND_COLOURS[label]), linewidth=1.0, linestyle="--", label=name)
