"""Users' logs with their observers -> .rrd: a board a log, and the same pages for all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import rerun.blueprint as rrb

from cmg_mj.visualization.recording.signals import Lines, Series, log_series, numbered
from cmg_mj.visualization.recording.stream import application_of, log_page, recorded
from cmg_mj.visualization.recording.views import Choice, Plot, pages, plot

TIMELINE = "time"
"""The log's own."""
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
    """All that is recorded of one log.

    Attributes:
        name: Of the log; no two alike in a recording.
        series: Its lines, in the folders that `PLOTS` names: angles in degrees, rates in rad/s.
        observers: Names of all observers.
        shown: Of the few that are switched on at first.
    """

    name: str
    series: Sequence[Series]
    observers: Sequence[str]
    shown: Sequence[str]


def write_logs(path: Path, title: str, logs: Sequence[LogSeries], texts: Mapping[str, str]) -> None:
    """Write some logs as one recording; whole or not at all.

    Args:
        path: The file, `recording.rrd`.
        title: The recording's name.
        logs: The logs; each has a branch of its own.
        texts: Title -> Markdown: the pages, the first of them in front.

    Raises:
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    names = [log.name for log in logs]
    branches = [
        Lines(path=f"/{part}", label=log.name, series={row.path: row for row in log.series}, timeline=TIMELINE)
        for part, log in zip(numbered(names), logs, strict=True)
    ]
    boards = [_board(branch, log, list(texts)) for branch, log in zip(branches, logs, strict=True)]
    blueprint = rrb.Blueprint(
        rrb.Tabs(*boards, active_tab=0) if len(boards) > 1 else boards[0],
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="paused"),
        auto_views=False,
        auto_layout=False,
    )
    with recorded(path, title, application_of(names, branches), blueprint) as rec:
        for branch in branches:
            log_series(rec, branch)
        for name, text in texts.items():
            log_page(rec, name.lower(), text)


def _board(branch: Lines, log: LogSeries, titles: Sequence[str]) -> rrb.Container:
    """Everything about one log. The others than the few are in the legends, to be switched on."""
    there = [what for what in PLOTS if any(path.startswith(what.entities) for path in branch.series)]
    views = []
    for what in there:
        among = {row.observer for path, row in branch.series.items() if path.startswith(what.entities)}
        shown = [name for name in log.shown if name in among] or [name for name in log.observers if name in among]
        views.append(plot(what, branch, Choice(shown, listed=True)))
    left = [view for what, view in zip(there, views, strict=True) if what in MAIN]
    right = [view for what, view in zip(there, views, strict=True) if what not in MAIN]
    return rrb.Horizontal(
        rrb.Vertical(*left, row_shares=[what.height for what in MAIN if what in there]),
        rrb.Vertical(pages(titles, titles[0]), *right, row_shares=[3.5, *[1.0] * len(right)]),
        column_shares=[11, 9],
        name=branch.label,
    )
