"""Plots. No other part of the package imports matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cmg_mj.picture import Panel, Picture
from cmg_mj.trajectory import Trajectory, whole_file


def _pyplot() -> Any:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


def draw(path: Path, picture: Picture) -> None:
    """Draw a picture.

    Args:
        path: The PNG to write.
        picture: What to draw.
    """
    plt = _pyplot()
    columns = picture.columns
    rows = -(-len(picture.panels) // columns)
    size = (9.0 if columns == 1 else 5.5 * columns, 0.8 + 2.3 * rows)
    figure, grid = plt.subplots(
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
    figure.suptitle(picture.title, x=0.01, ha="left", parse_math=False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=100, format="png")
    plt.close(figure)


def _draw_panel(axes: Any, panel: Panel) -> None:
    for line in panel.lines:
        style = {"linewidth": line.width, "label": line.label or None}
        if line.color is not None:
            style["color"] = f"C{line.color}"
        (drawn,) = axes.plot(line.x, line.y, line.style, markersize=4, **style)
        if line.spread is not None:
            low, high = np.subtract(line.y, line.spread), np.add(line.y, line.spread)
            axes.fill_between(line.x, low, high, color=drawn.get_color(), alpha=0.2, linewidth=0)
    for start, end in panel.shaded:
        axes.axvspan(start, end, color="C3", alpha=0.25, linewidth=0, zorder=0)
    axes.set_xscale(panel.x_scale)
    axes.set_yscale(panel.y_scale)
    axes.set_ylabel(panel.y_label)
    axes.set_title(panel.title, loc="left", fontsize="medium")
    axes.grid(alpha=0.3)
    marks_only = all(set(line.style) <= set("o.x+s") for line in panel.lines)
    axes.margins(x=0.0 if panel.x_scale == "linear" and not marks_only else 0.03)
    if panel.y_range is not None:
        axes.set_ylim(*panel.y_range)
    if any(line.label for line in panel.lines):
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize="small", ncols=4, frameon=False, borderpad=0)


def plot_run(path: Path, trajectory: Trajectory, title: str) -> None:
    """Plot a run as aranovskiy2020's Figs 4 to 7 do: tilt, tilt rate with a panel an observer, gimbal angle, command.

    Args:
        path: The PNG to write.
        trajectory: One world.
        title: Above the plot.
    """
    plt = _pyplot()
    t = trajectory["time_s"]
    n = len(trajectory.observers)
    figure, panels = plt.subplots(3 + n, 1, sharex=True, figsize=(9.0, 7.5 + 1.75 * n), layout="constrained")
    tilt, *rates, gimbal, command = panels
    tilt.plot(t, np.degrees(trajectory["y1_rad"]), color="0.7", linewidth=0.8, label="measured $y_1$")
    tilt.plot(t, np.degrees(trajectory["x1_rad"]), color="C0", label="true $x_1$ (from equilibrium)")
    tilt.set_ylabel("tilt [deg]")
    fog = trajectory["fog_rad_s"]
    low, high = (float(fog.min()), float(fog.max())) if len(fog) else (0.0, 0.0)
    room = 0.75 * max(high - low, 0.05)  # an estimate may be far off, and would leave no room for the others
    for i, (name, axes) in enumerate(zip(trajectory.observers, rates, strict=True)):
        label = f"{name} $\\hat x_2$" + (", riding along" if i else "")
        axes.plot(t, trajectory[f"estimate/{name}/x2_rad_s"], color=f"C{i + 1}", linewidth=0.8, label=label)
        axes.plot(t, fog, color="0.15", linewidth=1.2, label="gyro")
        axes.set_ylim(low - room, high + room)
        axes.set_ylabel("tilt rate\n[rad/s]")
    gimbal.plot(t, np.degrees(trajectory["x3_rad"]), color="C0", label="true $x_3$")
    gimbal.set_ylabel("gimbal angle\n[deg]")
    command.step(t, trajectory["u_rad_s"], where="post", color="C0", linewidth=0.8, label="$u$")
    command.set_ylabel("gimbal rate\n[rad/s]")
    command.set_xlabel("time [s]")
    pushed = trajectory["push_n_m"] != 0.0
    for axes in panels:
        if pushed.any():
            in_panel = axes.get_xaxis_transform()
            style = {"color": "C3", "alpha": 0.25, "linewidth": 0, "zorder": 0}
            axes.fill_between(
                t, 0, 1, where=pushed, transform=in_panel, label="push" if axes is tilt else None, **style
            )
        axes.grid(alpha=0.3)
        axes.margins(x=0.0)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize="small", ncols=3, frameon=False, borderpad=0)
    figure.align_ylabels()
    figure.suptitle(title, x=0.01, ha="left", parse_math=False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=110, format="png")
    plt.close(figure)
