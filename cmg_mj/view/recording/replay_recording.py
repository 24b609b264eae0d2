"""Writes users' logs with their observers as a rerun recording: a board for each log, and common pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import rerun.blueprint as rrb

from cmg_mj.view.recording.run import numbered_parts
from cmg_mj.view.recording.signals import Lines, Series, log_styles, log_values
from cmg_mj.view.recording.stream import application_name, log_page, open_recording
from cmg_mj.view.recording.views import Plot, page_tabs, plot_view, tabbed_blueprint

TIMELINE = "time"
"""Name of the timeline: a log's time is not simulated."""
MAIN = (
    Plot("Tilt [deg]", ("tilt/",), 1.7),
    Plot("Tilt rate [rad/s]", ("rate/", "rate_estimate/"), 2.8),
    Plot("Estimate less reference [rad/s]", ("rate_error/",), 2.8),
)
PLOTS = (
    *MAIN,
    Plot("Estimated equilibrium bias [deg]", ("bias/",)),
    Plot("Angular acceleration, measured [rad/s^2]", ("acceleration/",)),
    Plot("Command, gimbal rate [rad/s]", ("command/",)),
    Plot("Gimbal angle from upright [deg]", ("gimbal/",)),
)


@dataclass(frozen=True)
class LogSeries:
    """The recorded series of one log.

    Attributes:
        name: Name of the log, unique in a recording.
        series: The series, in the folders that `PLOTS` names: angles in degrees, rates in rad/s.
        best: Names of the observers that are switched on at first.
    """

    name: str
    series: Sequence[Series]
    best: Sequence[str]


def write_logs(path: Path, title: str, logs: Sequence[LogSeries], texts: Mapping[str, str]) -> None:
    """Write logs as one recording; whole or not at all.

    Args:
        path: The file, `recording.rrd`.
        title: The recording's name.
        logs: The logs; each has a branch.
        texts: Title -> Markdown of the pages; the first page is in front.

    Raises:
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    names = [log.name for log in logs]
    branches = [
        Lines(path=f"/{part}", label=log.name, series={row.path: row for row in log.series}, timeline=TIMELINE)
        for part, log in zip(numbered_parts(names), logs, strict=True)
    ]
    boards = [_board(branch, log, list(texts)) for branch, log in zip(branches, logs, strict=True)]
    blueprint = tabbed_blueprint(boards, TIMELINE, "paused")
    with open_recording(path, title, application_name(names, branches), blueprint) as rec:
        for branch in branches:
            log_styles(rec, branch)
            log_values(rec, branch)
        for name, text in texts.items():
            log_page(rec, name.lower(), text)


def _board(branch: Lines, log: LogSeries, titles: Sequence[str]) -> rrb.Container:
    """Lay out everything about one log. The legends have all observers, most of them switched off."""
    plots = [plot for plot in PLOTS if any(path.startswith(plot.entities) for path in branch.series)]
    views = {plot: plot_view(plot, branch, log.best, full_legend=True) for plot in plots}
    left = [view for plot, view in views.items() if plot in MAIN]
    right = [view for plot, view in views.items() if plot not in MAIN]
    return rrb.Horizontal(
        rrb.Vertical(*left, row_shares=[plot.height for plot in MAIN if plot in views]),
        rrb.Vertical(page_tabs(titles, titles[0]), *right, row_shares=[3.5, *[1.0] * len(right)]),
        column_shares=[11, 9],
        name=branch.label,
    )
