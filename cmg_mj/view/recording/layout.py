"""The layout of a recording, its pages in Markdown, and the properties by which a catalogue finds it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.results.floors import NOISE_ALONE
from cmg_mj.results.summary_keys import KEYS, OPEN_LOOP_COLUMNS, format_figure, heading
from cmg_mj.results.tables import markdown_table
from cmg_mj.scenario.resolve import versions
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing
from cmg_mj.view.plots.style import FEW, observers_to_draw
from cmg_mj.view.recording.run import LegendEntry, RecordingHeader, Run, recorded_poses
from cmg_mj.view.recording.scene import FLYWHEEL_SLOWDOWN, enclosing_ball
from cmg_mj.view.recording.signals import TIMELINE, Branch, Lines

PlayState = Literal["paused", "playing", "following"]
Override = rr.SeriesLines | rrb.EntityBehavior


@dataclass(frozen=True)
class Plot:
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
)
COMPARED_TILT_PLOTS = (
    Plot("Tilt, true [deg]", ("tilt/true",)),
    Plot("Estimation error of the tilt rate [rad/s]", ("rate_error/",)),
)
COMPARED_ACTUATOR_PLOTS = (
    Plot("Command, gimbal rate [rad/s]", ("command/u",)),
    Plot("Gimbal angle of the first module from upright [deg]", ("gimbal/",)),
    Plot("Integrator [rad s]", ("integrator/x_e",)),
)

LANE, COLUMN = 0.045, 0.6
"""Height of a lane of phases, and the largest of all lanes, in heights of the column."""
EYE = (1.48, -1.65, 0.63)
"""Vector from the rig's centre to the camera, in radii of the rig: a square view holds all of the rig."""
BACKGROUND = (58, 63, 71)
ALL = "All observers"


def default_blueprint(branches: Sequence[Branch], play_state: PlayState = "playing") -> rrb.Blueprint:
    """Lay out a recording.

    Args:
        branches: The runs.
        play_state: Whether the viewer plays from the start or follows the newest ticks.

    Returns:
        A board for one run; for several, a comparison and a tab for each. Of more than a few observers the best are
        switched on, and another tab has all of them in its legends.
    """
    several = len(branches) > 1
    has_observers = not several or any(branch.run.open_loop_observers for branch in branches)
    pages = ["Summary", *(["Observers"] if has_observers else []), "Scenario"]
    boards = [_board(branch.label, [branch], pages) for branch in branches]
    if several:
        best = [branch for branch in branches if branch.entry.is_best]
        boards.insert(0, _board("Comparison" if branches[0].run.axis is None else "All axes", branches, pages))
        if len(best) < len(branches):
            boards.insert(1, _board(ALL, branches, pages, full_legend=True))
    elif len(branches[0].observers) > FEW:
        boards.append(_board(ALL, branches, pages, full_legend=True))
    return tabbed_blueprint(boards, TIMELINE, play_state)


def _board(name: str, branches: Sequence[Branch], pages: Sequence[str], *, full_legend: bool = False) -> rrb.Container:
    """Lay out everything about one run, or several over each other."""
    best = [branch for branch in branches if branch.entry.is_best or len(branches) == 1]
    lanes = branches if full_legend else best
    if len(branches) == 1:
        names = [entry.name for entry in branches[0].observers if entry.is_best]
        kinds = [[plot for plot in plots if _rows(plot, branches[0])] for plots in (TILT_PLOTS, ACTUATOR_PLOTS)]
        columns = [[plot_view(plot, branches[0], names, full_legend=full_legend) for plot in plots] for plots in kinds]
    else:
        kinds = [list(COMPARED_TILT_PLOTS), list(COMPARED_ACTUATOR_PLOTS)]
        columns = [[_overlay_view(plot, branches, full_legend=full_legend) for plot in plots] for plots in kinds]
    heights = [[plot.height for plot in plots] for plots in kinds]
    lane = min(LANE * (1.3 + len(lanes)), COLUMN)
    is_open_loop = len(branches) == 1 and branches[0].run.open_loop_observers
    return rrb.Horizontal(
        rrb.Vertical(
            rrb.Tabs(*map(mechanism_view, best), active_tab=0),
            page_tabs(pages, "Observers" if is_open_loop else "Summary"),
        ),
        rrb.Vertical(phase_lanes(lanes), *columns[0], row_shares=[lane / (1.0 - lane) * sum(heights[0]), *heights[0]]),
        rrb.Vertical(*columns[1], row_shares=heights[1]),
        column_shares=[9, 8, 6],
        name=name,
    )


def _rows(plot: Plot, branch: Lines) -> list[str]:
    """List the paths of a plot's series."""
    return [path for path in branch.series if path.startswith(plot.entities)]


def _switched(is_on: bool, full_legend: bool) -> Override:
    """Switch a line on or off: in the legend, where a click switches it, or out of the legend."""
    return rr.SeriesLines(visible_series=[is_on]) if full_legend else rrb.EntityBehavior(visible=is_on)


def plot_view(plot: Plot, branch: Lines, best: Collection[str], *, full_legend: bool = False) -> rrb.View:
    """Lay out a plot of one run or log, with all its observers, only the best of them switched on.

    Args:
        plot: The plot.
        branch: The run or log.
        best: Names of the best observers.
        full_legend: Whether the legend has the others too; otherwise the list of the view's entities has them.
    """
    by_observer = {path: branch.series[path].observer for path in _rows(plot, branch)}
    estimating = {name: {} for name in by_observer.values() if name}
    shown = set(best) & set(estimating) or set(observers_to_draw(estimating))
    overrides: dict[str, list[Override]] = {
        f"{branch.path}/{path}": [_switched(False, full_legend)]
        for path, name in by_observer.items()
        if name and name not in shown
    }
    contents = [f"{branch.path}/{entity}**" for entity in plot.entities]
    return _series_view(plot.title, branch.path, contents, overrides)


def _overlay_view(plot: Plot, branches: Sequence[Branch], *, full_legend: bool) -> rrb.View:
    """Lay out a plot of the same series of all runs, each in its run's colour."""
    overrides: dict[str, list[Override]] = {}
    for branch in branches:
        observers = ("", branch.run.trajectory.observers[0])
        path = next(path for path in _rows(plot, branch) if branch.series[path].observer in observers)
        style = {"colors": [branch.entry.color], "names": [branch.label], "widths": [1.5]}
        is_on = branch.entry.is_best
        overrides[f"{branch.path}/{path}"] = (
            [rr.SeriesLines(visible_series=[is_on], **style)]
            if full_legend
            else [_switched(is_on, False), rr.SeriesLines(**style)]
        )
    return _series_view(plot.title, "/", list(overrides), overrides)


def _series_view(title: str, origin: str, contents: list[str], overrides: dict[str, list[Override]]) -> rrb.View:
    return rrb.TimeSeriesView(
        origin=origin,
        contents=contents,
        name=title,
        overrides={**overrides},
        axis_x=_time_axis(),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=True),
    )


def mechanism_view(branch: Branch) -> rrb.View:
    """Lay out the moving mechanism, all of it in view."""
    _, qpos = recorded_poses(branch.plant, branch.run.trajectory)
    ball = enclosing_ball(branch.plant, qpos)
    return rrb.Spatial3DView(
        origin=f"{branch.path}/rig",
        name=f"{branch.label} (flywheels drawn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed)",
        eye_controls=rrb.EyeControls3D(
            position=ball.centre + ball.radius * np.array(EYE), look_target=ball.centre, eye_up=(0.0, 0.0, 1.0)
        ),
        line_grid=False,
        background=rrb.Background(color=BACKGROUND),
    )


def phase_lanes(branches: Iterable[Branch]) -> rrb.View:
    """Lay out a lane of phases for each run."""
    contents = [f"{branch.path}/phase" for branch in branches]
    return rrb.StateTimelineView(origin="/", contents=contents, name="Phase", time_view=_time_axis())


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


ROW_TABLES = (
    ("velocity_rms_error_push_rad_s", "velocity_fit"),
    ("velocity_rms_error_rad_s", "settle_time_s", "tilt_rms_deg"),
    ("velocity_fit_push", "gimbal_peak_deg", "command_rms_rad_s"),
)
"""Keys of the tables with a row for each run, no wider than their view; the first key ranks the runs."""

OPEN_LOOP_TABLES = (OPEN_LOOP_COLUMNS[:2], OPEN_LOOP_COLUMNS[2:])
"""Keys of the tables with a row for each observer."""

BOLD = "In bold: those that are switched on in the plots; the legends of the other tab switch on any."
NOTES = f"In the 3-D view the flywheels turn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed."


def log_pages(rec: rr.RecordingStream, header: RecordingHeader, branches: Sequence[Branch]) -> None:
    """Record the properties and pages of finished runs."""
    package_versions = {name: versions()[name] for name in ("cmg_mj", "mujoco")}
    names = [branch.run.name for branch in branches]
    rec.send_property("experiment", rr.AnyValues(True, **package_versions, title=header.title, runs=names))
    for run in (branch.run for branch in branches):
        numbers = {key: value for key, value in run.summary.items() if isinstance(value, float)}
        values = rr.AnyValues(True, **numbers, outcome=run.outcome.kind, time_s=run.outcome.time_s)
        rec.send_property(rr.escape_entity_path_part(run.name), values)
    log_page(rec, "summary", summary_page(header, branches))
    if observers := observers_page(branches):
        log_page(rec, "observers", observers)
    log_page(rec, "scenario", f"# Scenario\n\n```toml\n{header.scenario_toml.strip()}\n```\n")


def summary_page(header: RecordingHeader, branches: Sequence[Branch]) -> str:
    """Write the page of summaries in Markdown."""
    tables = [_by_column(branches)] if len(branches) <= FEW else _by_row(branches)
    band = f"Settled: the tilt stays within ±{header.settings.settle_band_deg:g}° to the end."
    runs = [branch.run for branch in branches]
    reasons = [f"**{run.name}**: {run.outcome.reason}" for run in runs if run.outcome.reason]
    return _paragraphs(
        f"# {header.title or 'Run'}", *tables, _pushes(header.pushes), *_swings(header.swings), band, *reasons, NOTES
    )


def observers_page(branches: Sequence[Branch]) -> str:
    """Write the page of all observers of a run; of several runs, of those with open-loop observers."""
    selection = [branch for branch in branches if len(branches) == 1 or branch.run.open_loop_observers]
    return _paragraphs(*(part for branch in selection for part in _estimates(branch)))


def _estimates(branch: Branch) -> list[str]:
    """Write tables of one run's observers and, below them, its baselines."""
    run = branch.run
    names = [*map(_marked, branch.observers), *run.references]
    summaries = [*run.observers.values(), *run.references.values()]
    intro = f"In the run of {run.name}.{' The others are open loop.' if len(names) > 1 else ''}"
    parts = [f"{intro} {BOLD}" if len(run.observers) > FEW else intro]
    for keys in OPEN_LOOP_TABLES:
        rows = [
            (name, *(format_figure(key, summary.get(key)) for key in keys))
            for name, summary in zip(names, summaries, strict=True)
        ]
        parts.append(markdown_table(("", *map(heading, keys)), rows))
    return [*parts, NOISE_ALONE] if run.references else parts


def _by_column(branches: Sequence[Branch]) -> str:
    """Write a table with a column for each run."""
    runs = [branch.run for branch in branches]
    rows = [("Outcome", *map(_outcome, runs))]
    rows += [
        (heading(key), *(format_figure(key, run.summary.get(key)) for run in runs))
        for key in KEYS
        if any(key in run.summary for run in runs)
    ]
    return markdown_table(("", *(branch.label for branch in branches)), rows)


def _by_row(branches: Sequence[Branch]) -> list[str]:
    """Write tables with a row for each run."""
    runs = [branch.run for branch in branches]
    first = [[_marked(branch.entry) for branch in branches], [_outcome(run) for run in runs]]
    tables = []
    for i, keys in enumerate(ROW_TABLES):
        columns = [[format_figure(key, run.summary.get(key)) for run in runs] for key in keys]
        text = first if i == 0 else first[:1]
        headings = (*("", "Outcome")[: len(text)], *map(heading, keys))
        tables.append(markdown_table(headings, list(zip(*text, *columns, strict=True)), text_columns=len(text)))
    return [*tables, BOLD]


def _marked(entry: LegendEntry) -> str:
    """Shorten a name; make one that is switched on bold."""
    return f"**{entry.label}**" if entry.is_best else entry.label


def _outcome(run: Run) -> str:
    return f"{run.outcome.kind} at {run.outcome.time_s:.4g} s"


def _pushes(pushes: Sequence[Push]) -> str:
    if not pushes:
        return "No push."
    texts = (
        f"{p.torque_n_m:+g} N m{f' about {p.axis}' if p.axis else ''} for {p.duration_s:g} s at {p.start_s:g} s"
        for p in pushes
    )
    return "Pushes: " + "; ".join(texts) + "."


def _swings(swings: Sequence[Swing]) -> list[str]:
    texts = (
        f"{s.amplitude_n_m:g} N m{f' about {s.axis}' if s.axis else ''} at {s.frequency_hz:g} Hz from {s.start_s:g} s "
        f"{'to the end' if s.duration_s is None else f'for {s.duration_s:g} s'}"
        for s in swings
    )
    return ["Swings: " + "; ".join(texts) + "."] if swings else []


def _paragraphs(*parts: str) -> str:
    return "\n\n".join(parts) + "\n" if parts else ""


def log_page(rec: rr.RecordingStream, path: str, page: str) -> None:
    """Record a page of Markdown."""
    rec.log(path, rr.TextDocument(page, media_type=rr.MediaType.MARKDOWN), static=True)
