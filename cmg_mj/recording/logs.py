"""Replays of users' logs -> .rrd: what was measured, what the observers say, how far off they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from cmg_mj.colours import YARDSTICKS, colours
from cmg_mj.legible import shortened
from cmg_mj.log_replay import Replayed
from cmg_mj.log_report import replay_markdown, shown_first
from cmg_mj.logs.log import REFERENCE
from cmg_mj.observers.protocol import BIAS
from cmg_mj.recording.signals import CONTROLLER, CUBES, Lines, Series, log_series, numbered
from cmg_mj.recording.stream import application_of, log_page, recorded
from cmg_mj.recording.views import Choice, Plot, pages, plot

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


def write_replay(path: Path, replays: Sequence[Replayed], names: Sequence[str], settings_toml: str) -> None:
    """Write the replays of some logs as one recording; whole or not at all.

    Args:
        path: The file, `recording.rrd`.
        replays: The replays; each has a branch of its own.
        names: Their names, no two alike.
        settings_toml: What was asked for.

    Raises:
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    branches = [
        Lines(path=f"/{part}", label=name, series={row.path: row for row in series(replayed)}, timeline=TIMELINE)
        for part, name, replayed in zip(numbered(names), names, replays, strict=True)
    ]
    boards = [_board(branch, replayed) for branch, replayed in zip(branches, replays, strict=True)]
    blueprint = rrb.Blueprint(
        rrb.Tabs(*boards, active_tab=0) if len(boards) > 1 else boards[0],
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="paused"),
        auto_views=False,
        auto_layout=False,
    )
    title = f"Replay: {', '.join(names)}"
    with recorded(path, title, application_of([*names], branches), blueprint) as rec:
        for branch in branches:
            log_series(rec, branch)
        log_page(rec, "summary", f"# {title}\n\n{replay_markdown(replays)}\n")
        log_page(rec, "settings", f"# Settings\n\n```toml\n{settings_toml.strip()}\n```\n")


def series(replayed: Replayed) -> list[Series]:
    """All time series of one log: angles in degrees, rates in rad/s."""
    log = replayed.log

    def row(path: str, name: str, values: np.ndarray, color: tuple, width: float = 1.5, **more: object) -> Series:
        return Series(path, name, *log.broken(values), color, width, **more)  # type: ignore[arg-type]

    rows = [row("tilt/measured", "measured", np.degrees(log["y1_rad"]), YARDSTICKS["gyro"])]
    if "reference" in log.has:
        rows.append(row("rate/true", "reference", log[REFERENCE], YARDSTICKS["true"], 3.0))
    labels, names = shortened(list(replayed.estimates)), list(replayed.estimates)
    for part, (name, color) in zip(numbered(names), colours(names).items(), strict=True):
        estimates = replayed.estimates[name]
        rate = estimates["x2_rad_s"]
        said = {"rate_estimate": rate}
        if "reference" in log.has:
            said["rate_error"] = rate - log[REFERENCE]
        if BIAS in estimates:
            said["bias"] = np.degrees(estimates[BIAS])
        for folder, values in said.items():
            rows.append(row(f"{folder}/{part}", labels[name], values, color, whole=False, observer=name))
    if "acceleration" in log.has:
        measured = log["acceleration_rad_s2"]
        rows.append(row("acceleration/measured", "measured", measured, YARDSTICKS["gyro"], 1.0, whole=False))
    if "gimbals" in log.has:
        rows.append(row("command/u", "command", log["u_rad_s"], CONTROLLER))
        rows.append(row("gimbal/y2", "measured", np.degrees(log["y2_rad"]), CUBES[0]))
    return rows


def _board(branch: Lines, replayed: Replayed) -> rrb.Container:
    """Everything about one log. The others than the few best are in the legends, to be switched on."""
    there = [what for what in PLOTS if any(path.startswith(what.entities) for path in branch.series)]
    few = shown_first(replayed)
    views = []
    for what in there:
        among = {row.observer for path, row in branch.series.items() if path.startswith(what.entities)}
        shown = [name for name in few if name in among] or [name for name in replayed.estimates if name in among]
        views.append(plot(what, branch, Choice(shown, listed=True)))
    left = [view for what, view in zip(there, views, strict=True) if what in MAIN]
    right = [view for what, view in zip(there, views, strict=True) if what not in MAIN]
    return rrb.Horizontal(
        rrb.Vertical(*left, row_shares=[what.height for what in MAIN if what in there]),
        rrb.Vertical(pages(["Summary", "Settings"], "Summary"), *right, row_shares=[3.5, *[1.0] * len(right)]),
        column_shares=[11, 9],
        name=branch.label,
    )
