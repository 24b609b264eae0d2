"""The layout of a recording: its tabs, plots, mechanism and lanes of phases; and its pages in Markdown."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.results.reports import about_floors, estimates_table, figures_table, outcome_in_words
from cmg_mj.results.summary_keys import OPEN_LOOP_COLUMNS
from cmg_mj.view.plots.style import FEW, observers_to_draw
from cmg_mj.view.recording.run import LegendEntry, RecordingHeader
from cmg_mj.view.recording.scene import FLYWHEEL_SLOWDOWN, enclosing_ball, recorded_poses
from cmg_mj.view.recording.signals import TIMELINE, Branch, Lines

PlayState = Literal["paused", "playing", "following"]


class Plot(NamedTuple):
    """A plot of time series.

    Attributes:
        title: Quantity and unit.
        entities: Paths below the run's branch, folders with their slash.
        height: Share of the column's height.
    """

    title: str
    entities: tuple[str, ...]
    height: float = 1.0


TILT_PLOTS = (
    Plot("Tilt [deg]", ("tilt/",), 1.9),
    Plot("Tilt rate [rad/s]", ("rate/", "rate_estimate/"), 2.75),
    Plot("Estimation error of the tilt rate [rad/s]", ("rate_error/",), 2.75),
    Plot("Estimated equilibrium bias [deg]", ("bias/",), 1.3),
)
"""The last one is shown only if an observer estimates the bias."""
ACTUATOR_PLOTS = (
    Plot("Command, gimbal rate [rad/s]", ("command/",), 3.0),
    Plot("Gimbal angles from upright [deg]", ("gimbal/",), 2.4),
    Plot("Flywheel speeds [rad/s]", ("flywheel/",), 1.8),
    Plot("Integrator [rad s]", ("integrator/",), 1.8),
    Plot("Places across the axis [m]", ("place/",), 2.4),
    Plot("Planned shares of the weight", ("support/",), 1.3),
)
"""The last two are those of a walk."""
COMPARED_TILT_PLOTS = (
    Plot("Tilt, true [deg]", ("tilt/true",)),
    Plot("Estimation error of the tilt rate [rad/s]", ("rate_error/",)),
)
COMPARED_ACTUATOR_PLOTS = (
    Plot("Command, gimbal rate [rad/s]", ("command/u",)),
    Plot("Gimbal angle of the first module from upright [deg]", ("gimbal/",)),
    Plot("Integrator [rad s]", ("integrator/x_e",)),
)

LANE = 0.045
"""Height of a lane of phases, in heights of the column."""
EYE = (1.48, -1.65, 0.63)
"""Vector from the rig's centre to the camera, in radii of the rig: a square view holds all of the rig."""
BACKGROUND = (58, 63, 71)

ROW_TABLES = (
    ("velocity_rms_error_push_rad_s", "velocity_fit"),
    ("velocity_rms_error_rad_s", "settle_time_s", "tilt_rms_deg"),
    ("velocity_fit_push", "gimbal_peak_deg", "command_rms_rad_s"),
)
"""Keys of the tables with a row for each run, no wider than their view; the first key ranks the runs."""
OPEN_LOOP_TABLES = (OPEN_LOOP_COLUMNS[:2], OPEN_LOOP_COLUMNS[2:])
"""Keys of the tables with a row for each observer."""
BOLD = "In bold: those that are switched on in the plots; the legends switch on any."
NOTES = f"In the 3-D view the flywheels turn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed."


def default_blueprint(branches: Sequence[Branch], play_state: PlayState = "playing") -> rrb.Blueprint:
    """Lay out a recording.

    Args:
        branches: The runs.
        play_state: Whether the viewer plays from the start or follows the newest ticks.

    Returns:
        A board for one run; for several, a comparison and a tab for each. The legends have all observers; of more than
        a few the best are switched on.
    """
    has_observers = len(branches) == 1 or any(branch.run.open_loop_observers for branch in branches)
    pages = ["Summary", *(["Observers"] if has_observers else []), "Scenario"]
    boards = [_board(branch.label, [branch], pages) for branch in branches]
    if len(branches) > 1:
        boards.insert(0, _board("Comparison" if branches[0].run.axis is None else "All axes", branches, pages))
    return tabbed_blueprint(boards, TIMELINE, play_state)


def _board(name: str, branches: Sequence[Branch], pages: Sequence[str]) -> rrb.Container:
    """Lay out everything about one run, or several over each other."""
    first, *others = branches
    best = [branch for branch in branches if branch.entry.is_best] if others else [first]
    kinds = (COMPARED_TILT_PLOTS, COMPARED_ACTUATOR_PLOTS) if others else (TILT_PLOTS, ACTUATOR_PLOTS)
    columns = [[plot for plot in plots if rows_of(plot, first)] for plots in kinds]
    shown = [entry.name for entry in first.observers if entry.is_best]
    left, right = (
        [_overlay_view(plot, branches) if others else plot_view(plot, first, shown) for plot in plots]
        for plots in columns
    )
    heights = [[plot.height for plot in plots] for plots in columns]
    lanes = LANE * (1.3 + len(best))
    phases = rrb.StateTimelineView(
        origin="/", contents=[f"{branch.path}/phase" for branch in best], name="Phase", time_view=_time_axis()
    )
    page = "Observers" if not others and first.run.open_loop_observers else "Summary"
    return rrb.Horizontal(
        rrb.Vertical(rrb.Tabs(*map(_mechanism_view, best), active_tab=0), page_tabs(pages, page)),
        rrb.Vertical(phases, *left, row_shares=[lanes / (1.0 - lanes) * sum(heights[0]), *heights[0]]),
        rrb.Vertical(*right, row_shares=heights[1]),
        column_shares=[9, 8, 6],
        name=name,
    )


def rows_of(plot: Plot, branch: Lines) -> list[str]:
    """List the paths of a plot's series."""
    return [path for path in branch.series if path.startswith(plot.entities)]


def plot_view(plot: Plot, branch: Lines, best: Collection[str]) -> rrb.View:
    """Lay out a plot of one run or log, with all its observers in the legend.

    Args:
        plot: The plot.
        branch: The run or log.
        best: Names of the observers that are switched on; if none of them is in the plot, a few others are.
    """
    by_observer = {path: branch.series[path].observer for path in rows_of(plot, branch)}
    estimating = {name: {} for name in by_observer.values() if name}
    shown = set(best) & set(estimating) or set(observers_to_draw(estimating))
    off = [path for path, name in by_observer.items() if name and name not in shown]
    overrides = {f"{branch.path}/{path}": rr.SeriesLines(visible_series=[False]) for path in off}
    return _series_view(plot.title, branch.path, [f"{branch.path}/{entity}**" for entity in plot.entities], overrides)


def _overlay_view(plot: Plot, branches: Sequence[Branch]) -> rrb.View:
    """Lay out a plot of the same series of all runs, each in its run's colour."""
    overrides = {}
    for branch in branches:
        observers = ("", branch.run.trajectory.observers[0])
        path = next(path for path in rows_of(plot, branch) if branch.series[path].observer in observers)
        overrides[f"{branch.path}/{path}"] = rr.SeriesLines(
            colors=[branch.entry.color],
            names=[branch.label],
            widths=[1.5],
            visible_series=[branch.entry.is_best],
        )
    return _series_view(plot.title, "/", list(overrides), overrides)


def _series_view(title: str, origin: str, contents: list[str], overrides: Mapping[str, rr.SeriesLines]) -> rrb.View:
    return rrb.TimeSeriesView(
        origin=origin,
        contents=contents,
        name=title,
        overrides={**overrides},
        axis_x=_time_axis(),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=True),
    )


def _mechanism_view(branch: Branch) -> rrb.View:
    """Lay out the moving mechanism, all of it in view."""
    ball = enclosing_ball(branch.plant, recorded_poses(branch.plant, branch.run.trajectory)[1])
    return rrb.Spatial3DView(
        origin=f"{branch.path}/rig",
        name=f"{branch.label} (flywheels drawn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed)",
        eye_controls=rrb.EyeControls3D(
            position=ball.centre + ball.radius * np.array(EYE), look_target=ball.centre, eye_up=(0.0, 0.0, 1.0)
        ),
        line_grid=False,
        background=rrb.Background(color=BACKGROUND),
    )


def page_tabs(names: Sequence[str], active: str) -> rrb.Container:
    """Lay out pages of text, one of them in front; the page `Summary` is the entity `/summary`."""
    views = [rrb.TextDocumentView(origin=f"/{name.lower()}", name=name) for name in names]
    return rrb.Tabs(*views, active_tab=list(names).index(active))


def tabbed_blueprint(boards: Sequence[rrb.Container], timeline: str, play_state: PlayState) -> rrb.Blueprint:
    """Lay out a recording as tabs of boards, or as a single board, with the panels hidden."""
    return rrb.Blueprint(
        rrb.Tabs(*boards, active_tab=0) if len(boards) > 1 else boards[0],
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=timeline, play_state=play_state),
        auto_views=False,
        auto_layout=False,
    )


def _time_axis() -> rrb.TimeAxis:
    return rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal)


def pages(header: RecordingHeader, branches: Sequence[Branch]) -> dict[str, str]:
    """Write the pages of finished runs in Markdown, by their entities' names."""
    tables = [part for branch in branches for part in _estimates(branch, alone=len(branches) == 1)]
    return {
        "summary": _summary_page(header, branches),
        **({"observers": _paragraphs(*tables)} if tables else {}),
        "scenario": f"# Scenario\n\n```toml\n{header.scenario_toml.strip()}\n```\n",
    }


def _summary_page(header: RecordingHeader, branches: Sequence[Branch]) -> str:
    runs = [branch.run for branch in branches]
    outcomes = {b.label: outcome_in_words(b.run.outcome.kind, b.run.outcome.time_s) for b in branches}
    if len(branches) <= FEW:
        parts = [figures_table({branch.label: branch.run.summary for branch in branches}, outcomes).markdown()]
    else:
        figures = {_marked(branch.entry): branch.run.summary for branch in branches}
        parts = [estimates_table("", figures, keys, named=False).markdown() for keys in ROW_TABLES]
        lost = [branch for branch in branches if branch.run.outcome.kind != "done"]
        parts += [BOLD, *(f"**{branch.label}**: {outcomes[branch.label]}" for branch in lost)]
    torques = [f"push of {push.words}" for push in header.pushes]
    torques += [f"swing of {swing.words}" for swing in header.swings]
    return _paragraphs(
        f"# {header.title or 'Run'}",
        *parts,
        f"Torques: {'; '.join(torques) or 'none'}.",
        f"Settled: the tilt stays within ±{header.settings.settle_band_deg:g}° to the end.",
        *(f"**{run.name}**: {run.outcome.reason}" for run in runs if run.outcome.reason),
        NOTES,
    )


def _estimates(branch: Branch, alone: bool) -> list[str]:
    """Write tables of one run's observers and, below them, its baselines; none of the only one of a comparison."""
    run = branch.run
    if not alone and not run.open_loop_observers:
        return []
    figures = {_marked(entry): run.observers[entry.name] for entry in branch.observers} | run.references
    others = " The others are open loop." if len(figures) > 1 else ""
    intro = f"In the run of {run.name}.{others}{f' {BOLD}' if len(run.observers) > FEW else ''}"
    tables = [estimates_table("", figures, keys, named=False).markdown() for keys in OPEN_LOOP_TABLES]
    return [intro, *tables, *([about_floors(run.references)] if run.references else [])]


def _marked(entry: LegendEntry) -> str:
    """Shorten a name; make one that is switched on bold."""
    return f"**{entry.label}**" if entry.is_best else entry.label


def _paragraphs(*parts: str) -> str:
    return "\n\n".join(parts) + "\n"
