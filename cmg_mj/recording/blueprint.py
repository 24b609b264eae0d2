"""How a recording opens: which views, where, and what they look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.colours import colours
from cmg_mj.plant import Plant
from cmg_mj.recording.run import ENDINGS
from cmg_mj.recording.scene import FLYWHEEL_SLOWDOWN, extent
from cmg_mj.recording.signals import Branch
from cmg_mj.recording.timeline import TIMELINE


@dataclass(frozen=True)
class Plot:
    """One plot.

    Attributes:
        title: What it shows and in which unit.
        entities: Paths below the run's branch, folders with their slash.
        height: Share of its column.
        corner: Where the legend hides least.
        needs_legend: Whether it has a legend even if that is long, because it explains the colours of all plots.
    """

    title: str
    entities: tuple[str, ...]
    height: float
    corner: rrb.Corner2D = rrb.Corner2D.RightTop
    needs_legend: bool = False


_LOW = rrb.Corner2D.RightBottom
TILT_PLOTS = (
    Plot("Tilt [deg]", ("tilt/",), 2.0),
    Plot("Tilt rate [rad/s]", ("rate/", "rate_estimate/"), 3.0, needs_legend=True),
    Plot("Estimation error of the tilt rate [rad/s]", ("rate_error/",), 2.0, _LOW),
)
BIAS_PLOT = Plot("Estimated equilibrium bias [deg]", ("bias/",), 1.5, _LOW)
"""Only where an observer estimates it."""
ACTUATOR_PLOTS = (
    Plot("Command, gimbal rate [rad/s]", ("command/",), 3.0),
    Plot("Gimbal angles from upright [deg]", ("gimbal/",), 2.4, _LOW),
    Plot("Flywheel speeds [rad/s]", ("flywheel/",), 1.8),
    Plot("Integrator [rad s]", ("integrator/",), 1.8, _LOW),
)
COMPARED_TILT_PLOTS = (
    Plot("Tilt, true [deg]", ("tilt/true",), 1.0, needs_legend=True),
    Plot("Estimation error of the tilt rate [rad/s]", ("rate_error/{observer}",), 1.0, _LOW),
)
COMPARED_ACTUATOR_PLOTS = (
    Plot("Command, gimbal rate [rad/s]", ("command/u",), 1.0),
    Plot("Gimbal angle of {cube} from upright [deg]", ("gimbal/{cube}",), 1.0, _LOW),
    Plot("Integrator [rad s]", ("integrator/x_e",), 1.0, _LOW),
)

EYE = (1.3, -1.45, 0.55)
"""From the rig's centre to the camera, in radii of the rig."""

BACKGROUND = (58, 63, 71)
LANE, COLUMN, MOST_LANES = 40.0, 820.0, 8
"""Height of a lane of phases and of a column of plots [pixels], and how many lanes are seen without scrolling."""
MOST_LEGENDS = 4
"""More lines than this are explained once, not in every plot."""


def default_blueprint(plant: Plant, branches: Sequence[Branch]) -> rrb.Blueprint:
    """Lay out a recording.

    Args:
        plant: The rig.
        branches: The runs.

    Returns:
        A dashboard for one run; for several, one that compares them, and a tab for each.
    """
    if len(branches) == 1:
        root = _dashboard(plant, branches[0])
    else:
        boards = [_dashboard(plant, branch) for branch in branches]
        root = rrb.Tabs(_comparison(plant, branches), *boards, active_tab=0)
    return rrb.Blueprint(
        root,
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing"),
        auto_views=False,
        auto_layout=False,
    )


def _dashboard(plant: Plant, branch: Branch) -> rrb.Container:
    """Everything about one run."""
    has_bias = any(path.startswith("bias/") for path in branch.series)
    tilt = (*TILT_PLOTS, BIAS_PLOT) if has_bias else TILT_PLOTS
    rig = _rig(plant, branch, f"Rig (flywheels drawn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed)")
    return _three_columns(
        branch.run.name,
        rrb.Vertical(rig, _pages(), row_shares=[3, 2]),
        _column(_phases([branch]), 1, [_plot(plot, branch) for plot in tilt], tilt),
        _column(None, 0, [_plot(plot, branch) for plot in ACTUATOR_PLOTS], ACTUATOR_PLOTS),
    )


def _comparison(plant: Plant, branches: Sequence[Branch]) -> rrb.Container:
    """All runs over each other."""
    rigs = rrb.Tabs(*(_rig(plant, branch, branch.run.name) for branch in branches), active_tab=0)
    cube = plant.cubes[0].name
    tilt = [_overlay(plot, branches, cube) for plot in COMPARED_TILT_PLOTS]
    actuators = [_overlay(plot, branches, cube) for plot in COMPARED_ACTUATOR_PLOTS]
    return _three_columns(
        "Comparison",
        rrb.Vertical(rigs, _pages(), row_shares=[3, 2]),
        _column(_phases(branches), len(branches), tilt, COMPARED_TILT_PLOTS),
        _column(None, 0, actuators, COMPARED_ACTUATOR_PLOTS),
    )


def _three_columns(name: str, *columns: rrb.Container | rrb.View) -> rrb.Container:
    return rrb.Horizontal(*columns, column_shares=[4, 4, 3], name=name)


def _column(phases: rrb.View | None, lanes: int, views: Sequence[rrb.View], plots: Sequence[Plot]) -> rrb.Container:
    """Plots below each other, and the lanes of phases above them."""
    if phases is None:
        return rrb.Vertical(*views, row_shares=[plot.height for plot in plots])
    top = LANE * (1.3 + min(lanes, MOST_LANES))
    share = (COLUMN - top) / sum(plot.height for plot in plots)
    return rrb.Vertical(phases, *views, row_shares=[top, *(plot.height * share for plot in plots)])


def _pages() -> rrb.Container:
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    scenario = rrb.TextDocumentView(origin="/scenario", name="Scenario")
    return rrb.Tabs(summary, scenario, active_tab=0)


def _rig(plant: Plant, branch: Branch, name: str) -> rrb.View:
    centre, radius = extent(plant)
    eye = centre + radius * np.array(EYE)
    return rrb.Spatial3DView(
        origin=f"{branch.path}/rig",
        name=name,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=centre, eye_up=(0.0, 0.0, 1.0)),
        line_grid=False,
        background=rrb.Background(color=BACKGROUND),
    )


def _phases(branches: Sequence[Branch]) -> rrb.View:
    contents = [f"{branch.path}/phase" for branch in branches]
    return rrb.StateTimelineView(origin="/", contents=contents, name="Phase", time_view=_time_axis())


def _plot(plot: Plot, branch: Branch) -> rrb.View:
    """A plot of one run."""
    shown = [row.values for path, row in branch.series.items() if path.startswith(plot.entities)]
    yardstick = [branch.series["rate/true"].values, np.zeros(1)]
    return rrb.TimeSeriesView(
        origin=branch.path,
        contents=[f"{branch.path}/{entity}**" for entity in plot.entities],
        name=plot.title,
        axis_x=_time_axis(),
        axis_y=_frame(yardstick, shown) if "rate" in plot.entities[0] else None,
        plot_legend=_legend(plot, len(shown)),
    )


def _overlay(plot: Plot, branches: Sequence[Branch], cube: str) -> rrb.View:
    """The same series of all runs, each in its run's colour."""
    colors = colours(branch.run.name for branch in branches)
    lines: dict[str, rr.SeriesLines] = {}
    shown, standing = [], []
    for branch in branches:
        name = branch.run.name
        observer = rr.escape_entity_path_part(branch.run.trajectory.observers[0])
        entity = plot.entities[0].format(cube=rr.escape_entity_path_part(cube), observer=observer)
        lines[f"{branch.path}/{entity}"] = rr.SeriesLines(colors=[colors[name]], names=[name], widths=[1.5])
        values = branch.series[entity].values
        shown.append(values)
        if branch.run.outcome.kind not in ENDINGS:
            standing.append(values)
    overrides: Mapping[str, rr.SeriesLines] = lines
    return rrb.TimeSeriesView(
        origin="/",
        contents=list(lines),
        name=plot.title.format(cube=cube),
        overrides=overrides,  # type: ignore[arg-type]
        axis_x=_time_axis(),
        axis_y=_frame(standing, shown),
        plot_legend=_legend(plot, len(shown)),
    )


def _frame(yardstick: Sequence[np.ndarray], shown: Sequence[np.ndarray]) -> rrb.ScalarAxis | None:
    """Keep what matters legible beside a line that shoots off: the yardstick's range and as much again on each side.

    Args:
        yardstick: Values that must be seen.
        shown: All that is plotted.

    Returns:
        The axis, or None if everything fits and may be shown whole.
    """
    sure = [values[np.isfinite(values)] for values in yardstick]
    everything = [values[np.isfinite(values)] for values in shown]
    if not sum(map(len, sure)) or not sum(map(len, everything)):
        return None
    low, high = (float(f(np.concatenate(sure))) for f in (np.min, np.max))
    lowest, highest = (float(f(np.concatenate(everything))) for f in (np.min, np.max))
    reach = high - low
    if reach == 0.0 or (lowest >= low - reach and highest <= high + reach):
        return None
    return rrb.ScalarAxis(range=(max(lowest, low - reach), min(highest, high + reach)))


def _legend(plot: Plot, lines: int) -> rrb.PlotLegend:
    return rrb.PlotLegend(corner=plot.corner, visible=plot.needs_legend or lines <= MOST_LEGENDS)


def _time_axis() -> rrb.TimeAxis:
    return rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal)
