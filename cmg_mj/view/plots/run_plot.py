"""The one-page plot of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmg_mj.results.reports import run_title
from cmg_mj.results.summary_keys import format_figure
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing
from cmg_mj.view.plots.figure import Line, Panel, Picture, Span, draw
from cmg_mj.view.plots.style import (
    BOUND_COLOURS,
    RANKING_KEYS,
    colour,
    hexadecimal,
    observers_to_draw,
    short_names,
    thinned,
)

if TYPE_CHECKING:  # it imports rerun
    from cmg_mj.view.recording import RecordingHeader, Run

INK = "0.15"
"""Colour of true signals on paper."""
MEASURED = hexadecimal(colour("gyro"))
GYRO = "#a9c4ef"
"""Colour of the gyro's thin line, which lies on the wide true one."""
SWING_COLOR, SWING_HEIGHT = "C4", 0.05
"""Colour of swings, and the share of a panel's height that a swing's strip takes."""
SMALL_COLUMNS, SMALL_ROWS = 4, 3
"""Grid of the small panels, one an observer."""


def plot_run(path: Path, header: RecordingHeader, run: Run) -> None:
    """Plot a run on one page: tilt, tilt rate, error of the estimates, gimbal angle, command.

    The observer in the loop and the best open-loop observers share the panels. Each other observer has a small panel.

    Args:
        path: The PNG to write.
        header: The experiment: its pushes, swings and bounds.
        run: The run, whose numbers rank the observers.
    """
    trajectory, axis = run.trajectory, run.axis
    title = run_title(run.summary) + (f", {axis}" if axis else "")
    pushes = [push for push in header.pushes if axis is None or push.axis == axis]
    first = header.plant.axis_names[0] if axis else None
    swings = [swing for swing in header.swings if axis is None or (swing.axis or first) == axis]
    t, true = trajectory["time_s"], trajectory["x2_rad_s"]
    ends = (float(t[0]), float(t[-1])) if len(t) else (0.0, 0.0)
    summaries = run.observers
    few = observers_to_draw(summaries, always=trajectory.observers[:1])
    others = [name for name in trajectory.observers if name not in few]
    labels = short_names(trajectory.observers)
    key = next((key for key in RANKING_KEYS if any(summaries[name].get(key) is not None for name in few)), "")

    def line(values: np.ndarray, label: str, color: str, width: float = 0.8) -> Line:
        return Line(*thinned(t, values), label, color=color, width=width)

    def true_line(signal: str, label: str, width: float = 1.3, scale: float = 1.0) -> Line:
        return line(scale * trajectory[signal], label, INK, width)

    def bounds(bound: float, label: str) -> list[Line]:
        color = hexadecimal(BOUND_COLOURS[label])
        return [Line(ends, [bound] * 2, label, "--", color), Line(ends, [-bound] * 2, "", "--", color)]

    tilt = [line(np.degrees(trajectory["y1_rad"]), "measured $y_1$", MEASURED, 0.6)]
    tilt += [true_line("x1_rad", "true $x_1$ (from equilibrium)", scale=np.degrees(1.0))]
    rates = [true_line("x2_rad_s", "true $x_2$", 2.4), line(trajectory["fog_rad_s"], "gyro", GYRO, 0.6)]
    errors = [Line([], [], "RMS in push windows:" if "push" in key else "RMS:", " ")] if key else []
    for name in few:
        estimate = trajectory[f"estimate/{name}/x2_rad_s"]
        rms = f" {format_figure(key, summaries[name].get(key))}" if key else ""
        rates.append(line(estimate, f"{labels[name]} $\\hat x_2$", name))
        errors.append(line(estimate - true, labels[name] + rms, name))
    # Errors on a scale of their own would look large.
    y_range = limits([curve.y for curve in [*rates, *errors]])
    gimbal = [true_line("x3_rad", "true $x_3$", scale=np.degrees(1.0))]
    command = [true_line("u_rad_s", "command $u$", 0.6)]
    spans = list(_spans(ends, pushes, swings))
    unnamed = [span._replace(label="") for span in spans]
    panels = [
        Panel("tilt [deg]", [*tilt, *bounds(header.settings.settle_band_deg, "settle band")], shaded=spans),
        Panel("tilt rate\n[rad/s]", rates, shaded=unnamed, y_range=y_range),
        Panel("error $\\hat x_2 - x_2$\n[rad/s]", errors, shaded=unnamed, y_range=y_range),
        Panel("gimbal angle\n[deg]", gimbal, shaded=unnamed),
        Panel("gimbal rate\n[rad/s]", [*command, *bounds(header.rate_limit_rad_s, "rate limit")], shaded=unnamed),
    ]
    for name in others:
        curves = [line(trajectory[f"estimate/{name}/x2_rad_s"], "", name, 0.5), true_line("x2_rad_s", "", 0.8)]
        panels.append(Panel("tilt rate [rad/s]", curves, labels[name], shaded=unnamed, y_range=y_range))
    columns = max(SMALL_COLUMNS, -(-len(others) // SMALL_ROWS))
    draw(path, Picture("plot", title, panels, columns=columns, n_first=5))


def limits(curves: Sequence[Sequence[float] | np.ndarray]) -> tuple[float, float] | None:
    """Return the ends of an axis with the finite values of some curves; None if there is no value."""
    values = np.concatenate([*curves, []])
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    margin = 0.05 * (np.ptp(values) or 1.0)
    return float(values.min() - margin), float(values.max() + margin)


def _spans(ends: tuple[float, float], pushes: Sequence[Push], swings: Sequence[Swing]) -> Iterator[Span]:
    """Shade pushes over the whole height; a swing, which may last, gets a strip at the foot."""
    start, end = ends
    spans = [Span(push.start_s, push.end_s, "push") for push in pushes if push.torque_n_m]
    for swing in swings:
        last = end if swing.duration_s is None else swing.start_s + swing.duration_s
        spans.append(Span(swing.start_s, last, "swing", SWING_COLOR, SWING_HEIGHT))
    named: set[str] = set()
    for span in spans:
        if span.start < end and span.end > start:
            label = "" if span.label in named else span.label
            named.add(span.label)
            yield span._replace(start=max(span.start, start), end=min(span.end, end), label=label)
