"""Tables for the terminal, and plots. No other part of the package imports matplotlib."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from cmg_mj.trajectory import Trajectory, whole_file

COLUMNS = (
    ("velocity_rms_error_rad_s", "velocity RMS\nerror [rad/s]", "{:.4f}"),
    ("velocity_rms_error_fog_rad_s", "against the\ngyro [rad/s]", "{:.4f}"),
    ("tilt_rms_deg", "tilt RMS\n[deg]", "{:.3f}"),
    ("settle_time_s", "settle\ntime [s]", "{:.2f}"),
    ("gimbal_peak_deg", "gimbal\npeak [deg]", "{:.1f}"),
    ("command_rms_rad_s", "command RMS\n[rad/s]", "{:.3f}"),
    ("command_saturated_fraction", "command\nlimited", "{:.1%}"),
    ("fell_fraction", "falls", "{:.0%}"),
)
"""Summary key, heading, format."""

LABELS = {
    "settle_time_s": "Settle time after the last push [s]",
    "velocity_rms_error_rad_s": "Velocity RMS error [rad/s]",
    "velocity_rms_error_fog_rad_s": "  against the gyro [rad/s]",
    "tilt_rms_deg": "Tilt RMS [deg]",
    "gimbal_peak_deg": "Gimbal peak [deg]",
    "command_rms_rad_s": "Command RMS [rad/s]",
    "command_saturated_fraction": "Share of ticks with the command limited",
}


def _cell(value: Any, pattern: str) -> str:
    return "-" if value is None else pattern.format(value)


def comparison_table(summaries: Sequence[Mapping[str, Any]], title: str) -> Table:
    """The table that `cmg-mj compare` prints."""
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column("observer")
    for _, heading, _ in COLUMNS:
        table.add_column(heading, justify="right")
    for summary in summaries:
        table.add_row(summary["observer"], *(_cell(summary[key], pattern) for key, _, pattern in COLUMNS))
    return table


def comparison_markdown(summaries: Sequence[Mapping[str, Any]]) -> str:
    """The same table in Markdown."""
    headings = ["observer", *(heading.replace("\n", " ") for _, heading, _ in COLUMNS)]
    lines = ["| " + " | ".join(headings) + " |", "|---|" + "---:|" * len(COLUMNS)]
    for summary in summaries:
        cells = [f"`{summary['observer']}`", *(_cell(summary[key], pattern) for key, _, pattern in COLUMNS)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def summary_table(summary: Mapping[str, Any]) -> Table:
    """The table that `cmg-mj run` prints."""
    ends = {"done": "stood to the end", "fell": "fell", "stopped": "stopped", "interrupted": "interrupted"}
    table = Table(
        title=f"{summary['scenario'] or 'Run'}: {summary['observer']}, seed {summary['seed']}",
        box=box.SIMPLE_HEAD,
        title_justify="left",
        show_header=False,
    )
    table.add_column()
    table.add_column(justify="right")
    table.add_row("Outcome", f"{ends[summary['outcome']]} at {summary['end_time_s']:.2f} s")
    for key, label in LABELS.items():
        table.add_row(label, _cell(summary[key], "{:.4f}"))
    for name, errors in summary.get("companions", {}).items():
        table.add_row(f"Velocity RMS error of {name} [rad/s]", _cell(errors["velocity_rms_error_rad_s"], "{:.4f}"))
    return table


def plot_run(path: Path, trajectory: Trajectory, title: str) -> None:
    """Plot a run as aranovskiy2020's Figs 4 to 7 do: tilt, velocity, command.

    Args:
        path: The PNG to write.
        trajectory: One world.
        title: Above the plot.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    t = trajectory["time_s"]
    figure, (tilt, rate, gimbal, command) = plt.subplots(4, 1, sharex=True, figsize=(9, 10), layout="constrained")
    tilt.plot(t, np.degrees(trajectory["y1_rad"]), color="0.7", linewidth=0.8, label="measured $y_1$")
    tilt.plot(t, np.degrees(trajectory["x1_rad"]), color="C0", label="true $x_1$ (from equilibrium)")
    tilt.set_ylabel("tilt [deg]")
    rate.plot(t, trajectory["fog_rad_s"], color="0.2", linewidth=2.0, label="gyro")
    for i, name in enumerate(trajectory.observers):
        rate.plot(
            t, trajectory[f"estimate/{name}/x2_rad_s"], color=f"C{i + 1}", linewidth=1.0, label=f"{name} $\\hat x_2$"
        )
    spread = float(np.max(np.abs(trajectory["fog_rad_s"]), initial=0.05))
    rate.set_ylim(-2.0 * spread, 2.0 * spread)
    rate.set_ylabel("tilt rate [rad/s]")
    gimbal.plot(t, np.degrees(trajectory["x3_rad"]), color="C0", label="true $x_3$")
    gimbal.set_ylabel("gimbal angle [deg]")
    command.step(t, trajectory["u_rad_s"], where="post", color="C0", linewidth=0.8, label="$u$")
    command.set_ylabel("gimbal rate [rad/s]")
    command.set_xlabel("time [s]")
    pushed = trajectory["push_n_m"] != 0.0
    for axes in (tilt, rate, gimbal, command):
        if pushed.any():
            axes.fill_between(
                t, 0, 1, where=pushed, transform=axes.get_xaxis_transform(), color="C3", alpha=0.3, linewidth=0
            )
        axes.grid(alpha=0.3)
        axes.legend(loc="upper right", fontsize="small", ncols=math.ceil(len(axes.lines) / 3))
    figure.suptitle(title)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=110, format="png")
    plt.close(figure)
