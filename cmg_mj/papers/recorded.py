"""Runs, readings and pictures of them that several papers need, and a step of Runge and Kutta."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cmg_mj.papers.claim import Array, Claim
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment
from cmg_mj.runs.side_by_side import BatchJob, run_jobs
from cmg_mj.view.plots.figure import Line, Panel, Picture


def run_settings(
    experiments: Sequence[Experiment], values: Mapping[str, Sequence[float]], worlds: int, keep_trajectory: bool = True
) -> list[list[Result]]:
    """Run the same worlds of every experiment at several settings.

    Args:
        experiments: The experiments.
        values: Field -> its value at each setting.
        worlds: Worlds a setting, with the same noise at each and for every experiment.
        keep_trajectory: Whether to record them.

    Returns:
        For each experiment a result a setting.
    """
    varied = {field: np.repeat(of, worlds) for field, of in values.items()}
    settings = len(next(iter(values.values())))
    jobs = [BatchJob(experiment.with_varied(varied), [*range(worlds)] * settings) for experiment in experiments]
    return [result.split(settings) for result in run_jobs(jobs, keep_trajectory=keep_trajectory)]


def trajectory_of(result: Result) -> Trajectory:
    """Return the recording of a result that kept it."""
    assert result.trajectory is not None
    return result.trajectory


def push_intervals(trajectory: Trajectory) -> list[tuple[float, float]]:
    """Find when the push acted on one world, as panels shade it [s]."""
    times = trajectory["time_s"][trajectory["push_n_m"] != 0.0]
    return [(times[0], times[-1])] if len(times) else []


def rms(values: Array) -> Any:
    """Return the root of the mean square over the ticks, (n_ticks, ...) -> (...)."""
    return np.sqrt(np.mean(values**2, axis=0))


def largest_size(values: Array) -> float:
    """Return the largest absolute value."""
    return np.abs(values).max()


def runge_kutta(slope: Callable[[float, Array], Array], x: Array, h: float) -> Array:
    """Take one classical step of x' = slope(share of the step, x)."""
    p = slope(0.0, x)
    q = slope(0.5, x + 0.5 * h * p)
    r = slope(0.5, x + 0.5 * h * q)
    return x + h / 6.0 * (p + 2.0 * (q + r) + slope(1.0, x + h * r))


def trace(run: Trajectory, column: str, label: str = "", **style: Any) -> Line:
    """Draw a column of one world over the time, angles in degrees."""
    values = run[column]
    return Line(run["time_s"], np.degrees(values) if column.endswith("_rad") else values, label, **style)


def loop_picture(
    picture: tuple[str, str], observer: tuple[str, str], runs: Mapping[str, Result], noise_width: float, gimbal: bool
) -> Picture:
    """Draw world 0 of each run in a column of its own, the observer in the loop beside the truth.

    Args:
        picture: Name and title of the picture.
        observer: Name of the observer, and its equation in the paper.
        runs: Title of a column -> its run.
        noise_width: Width of the measured tilt's line.
        gimbal: Whether the gimbal angle is drawn, too.

    Returns:
        The picture.
    """
    (name, equation), columns = observer, []
    for title, result in runs.items():
        run = trajectory_of(result).world(0)
        shaded = push_intervals(run)
        tilts = [
            trace(run, "y1_rad", "measured y1", color=7, width=noise_width),
            trace(run, "x1_rad", "true x1", color=0),
        ]
        rates = [
            trace(run, f"estimate/{name}/x2_rad_s", f"estimate of {equation}", color=1, width=0.6),
            trace(run, "x2_rad_s", "true x2", color=0),
        ]
        angles = Panel("gimbal angle [deg]", [trace(run, "x3_rad", "true x3", color=0)], shaded=shaded)
        columns.append(
            [
                Panel("tilt [deg]", tilts, title, shaded=shaded),
                Panel("tilt rate [rad/s]", rates, shaded=shaded),
                *[angles] * gimbal,
                Panel("command u [rad/s]", [trace(run, "u_rad_s", "u", color=3, width=0.6)], shaded=shaded),
            ]
        )
    return Picture(*picture, [panel for row in zip(*columns, strict=True) for panel in row], columns=len(columns))


def open_loop_panels(
    run: Trajectory,
    rates: Mapping[str, Array],
    observers: Mapping[str, str],
    tilt: Line,
    y_range: tuple[float, float],
) -> list[Panel]:
    """Draw one world's measured tilt and command, and what each observer makes of it in open loop, beside the gyro.

    Args:
        run: Recording of one world.
        rates: Observer -> its estimated tilt rate, (n_ticks,) [rad/s].
        observers: Observer -> its equation in the paper.
        tilt: Curve of the tilt; the others are as wide.
        y_range: Limits of the rates [rad/s].

    Returns:
        The panels.
    """
    shaded = push_intervals(run)
    panels = [
        Panel("tilt y1 [deg]", [tilt], "(a)", shaded=shaded),
        Panel("command u [rad/s]", [trace(run, "u_rad_s", "u", color=3, width=tilt.width)], shaded=shaded),
    ]
    for name, equation in observers.items():
        lines = [
            Line(tilt.x, rates[name], f"{equation} {name}", color=name, width=tilt.width),
            trace(run, "fog_rad_s", "gyro", style="k-"),
        ]
        panels.append(Panel("tilt rate [rad/s]", lines, "" if panels[2:] else "(b)", shaded=shaded, y_range=y_range))
    return panels


ROOM = 0.05
"""Left above and below what is drawn, as a share of its range."""


def on_common_scales(claims: Sequence[Claim]) -> list[Claim]:
    """Give all panels of one quantity, in all claims' pictures, the range that they all need."""
    values: dict[str, list[Array]] = {}
    for panel in (panel for claim in claims if claim.picture for panel in claim.picture.panels):
        values.setdefault(panel.y_label, []).extend(np.asarray(line.y) for line in panel.lines)

    def scaled(panel: Panel) -> Panel:
        drawn = np.concatenate(values[panel.y_label])
        low, high = np.nanmin(drawn), np.nanmax(drawn)
        return replace(panel, y_range=(low - ROOM * (high - low), high + ROOM * (high - low)))

    return [
        replace(claim, picture=claim.picture and replace(claim.picture, panels=[*map(scaled, claim.picture.panels)]))
        for claim in claims
    ]
