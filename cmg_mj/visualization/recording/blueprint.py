"""Lays out a recording: the places of the views, and the observers that are switched on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import rerun.blueprint as rrb

from cmg_mj.plant.plant import Plant
from cmg_mj.visualization.plots.readability import FEW
from cmg_mj.visualization.recording.branch import Branch
from cmg_mj.visualization.recording.run import best_observers
from cmg_mj.visualization.recording.scene import FLYWHEEL_SLOWDOWN
from cmg_mj.visualization.recording.signals import TIMELINE
from cmg_mj.visualization.recording.views import (
    Choice,
    Plot,
    mechanism_view,
    overlay_view,
    page_tabs,
    phase_lanes,
    plot_view,
    tabbed_blueprint,
)

ESTIMATE_PLOTS = (
    Plot("Tilt rate [rad/s]", ("rate/", "rate_estimate/"), 2.75),
    Plot("Estimation error of the tilt rate [rad/s]", ("rate_error/",), 2.75),
)
TILT_PLOTS = (Plot("Tilt [deg]", ("tilt/",), 1.9), *ESTIMATE_PLOTS)
BIAS_PLOT = Plot("Estimated equilibrium bias [deg]", ("bias/",), 1.3)
"""Shown only if an observer estimates the bias."""
ACTUATOR_PLOTS = (
    Plot("Command, gimbal rate [rad/s]", ("command/",), 3.0),
    Plot("Gimbal angles from upright [deg]", ("gimbal/",), 2.4),
    Plot("Flywheel speeds [rad/s]", ("flywheel/",), 1.8, least=3.0),
    Plot("Integrator [rad s]", ("integrator/",), 1.8),
)
COMPARED_TILT_PLOTS = (
    Plot("Tilt, true [deg]", ("tilt/true",)),
    Plot("Estimation error of the tilt rate [rad/s]", ("rate_error/",)),
)
COMPARED_ACTUATOR_PLOTS = (
    Plot("Command, gimbal rate [rad/s]", ("command/u",)),
    Plot("Gimbal angle of {module} from upright [deg]", ("gimbal/{module}",)),
    Plot("Integrator [rad s]", ("integrator/x_e",)),
)

LANE, COLUMN = 40.0, 870.0
"""Height of a lane of phases and of a column of plots in a window of 900 points [points]."""
FRAME = 44.0
"""Height of a plot's title and time axis [points]."""

ALL = "All observers"


def default_blueprint(plant: Plant, branches: Sequence[Branch], *, live: bool = False) -> rrb.Blueprint:
    """Lay out a recording.

    Args:
        plant: The plant.
        branches: The runs.
        live: Whether the viewer follows the newest ticks instead of playing from the start.

    Returns:
        A dashboard for one run; for several, a comparison and a tab for each. Of more than a few observers the best are
        switched on, and another tab has all of them.
    """
    names = _page_names(branches)
    boards = [_dashboard(branch, names) for branch in branches]
    if len(branches) > 1:
        boards = [*_comparison(plant, branches), *boards]
    elif len(branches[0].run.observers) > FEW:
        boards.append(_all_observers(branches[0]))
    return tabbed_blueprint(boards, TIMELINE, "following" if live else "playing")


def _dashboard(branch: Branch, names: Sequence[str]) -> rrb.Container:
    """Lay out everything about one run."""
    tilt = (*TILT_PLOTS, BIAS_PLOT) if _has_bias(branch) else TILT_PLOTS
    tilt, actuators = _sized(tilt, COLUMN - _lanes_height([branch])), _sized(ACTUATOR_PLOTS, COLUMN)
    mechanism = mechanism_view(branch, f"Rig (flywheels drawn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed)")
    return _columns(
        branch.label,
        [9, 8, 6],
        rrb.Vertical(
            mechanism, page_tabs(names, "Observers" if branch.run.open_loop_observers else "Summary"), row_shares=[1, 1]
        ),
        _below_lanes([branch], tilt, _plot_views(tilt, branch)),
        _stack(actuators, _plot_views(actuators, branch)),
    )


def _all_observers(branch: Branch) -> rrb.Container:
    """Lay out the estimates of every observer of a run, with all observers in the legend."""
    rates = _plot_views(_sized(ESTIMATE_PLOTS, COLUMN), branch, full_legend=True)
    bias = _plot_views([BIAS_PLOT], branch, full_legend=True) if _has_bias(branch) else []
    return _columns(
        ALL, [3, 2], rrb.Vertical(*rates), rrb.Vertical(*bias, page_tabs(_page_names([branch]), "Observers"))
    )


def _comparison(plant: Plant, branches: Sequence[Branch]) -> list[rrb.Container]:
    """Lay out the best runs over each other; then, if there are more, all runs."""
    few = [branch.run.name for branch in branches if branch.entry.is_best]
    module = plant.axis.modules[0].of_axis
    best = [branch for branch in branches if branch.entry.is_best]
    tilt_plots = _sized(COMPARED_TILT_PLOTS, COLUMN - _lanes_height(best))
    actuator_plots = _sized(COMPARED_ACTUATOR_PLOTS, COLUMN)
    tilt = [overlay_view(plot, branches, module, Choice(few)) for plot in tilt_plots]
    actuators = [overlay_view(plot, branches, module, Choice(few)) for plot in actuator_plots]
    mechanisms = rrb.Tabs(*(mechanism_view(branch, branch.label) for branch in best), active_tab=0)
    names = _page_names(branches)
    board = _columns(
        "Comparison" if branches[0].run.axis is None else "All axes",
        [9, 8, 6],
        rrb.Vertical(mechanisms, page_tabs(names, "Summary"), row_shares=[1, 1]),
        _below_lanes(best, tilt_plots, tilt),
        _stack(actuator_plots, actuators),
    )
    if len(best) == len(branches):
        return [board]
    any_run = Choice(few, full_legend=True)
    lanes = _lanes_height(branches)
    all_runs = _columns(
        ALL,
        [9, 8, 6],
        rrb.Vertical(phase_lanes(branches), page_tabs(names, "Summary"), row_shares=[lanes, COLUMN - lanes]),
        rrb.Vertical(*(overlay_view(plot, branches, module, any_run) for plot in COMPARED_TILT_PLOTS)),
        rrb.Vertical(*(overlay_view(plot, branches, module, any_run) for plot in COMPARED_ACTUATOR_PLOTS[:2])),
    )
    return [board, all_runs]


def _plot_views(plots: Sequence[Plot], branch: Branch, *, full_legend: bool = False) -> list[rrb.View]:
    """Lay out plots; in each, switch the best observers on that have a line in the plot."""
    views = []
    for plot in plots:
        observers = {row.observer for path, row in branch.series.items() if path.startswith(plot.entities)}
        views.append(plot_view(plot, branch, Choice(best_observers(branch.run, observers), full_legend)))
    return views


def _has_bias(branch: Branch) -> bool:
    return any(path.startswith("bias/") for path in branch.series)


def _page_names(branches: Sequence[Branch]) -> list[str]:
    """Return the names of the pages."""
    has_observers = len(branches) == 1 or any(branch.run.open_loop_observers for branch in branches)
    return ["Summary", *(["Observers"] if has_observers else []), "Scenario"]


def _columns(name: str, shares: list[float], *columns: rrb.Container | rrb.View) -> rrb.Container:
    return rrb.Horizontal(*columns, column_shares=shares, name=name)


def _sized(plots: Sequence[Plot], height: float) -> tuple[Plot, ...]:
    """Give plots that share a column of some height [points] the heights that they get."""
    share = height / sum(plot.height for plot in plots)
    return tuple(replace(plot, points=plot.height * share - FRAME) for plot in plots)


def _stack(plots: Sequence[Plot], views: Sequence[rrb.View]) -> rrb.Container:
    """Lay out plots below each other."""
    return rrb.Vertical(*views, row_shares=[plot.height for plot in plots])


def _below_lanes(lanes: Sequence[Branch], plots: Sequence[Plot], views: Sequence[rrb.View]) -> rrb.Container:
    """Lay out plots below each other, and the lanes of phases above them."""
    top = _lanes_height(lanes)
    share = (COLUMN - top) / sum(plot.height for plot in plots)
    return rrb.Vertical(phase_lanes(lanes), *views, row_shares=[top, *(plot.height * share for plot in plots)])


def _lanes_height(lanes: Sequence[Branch]) -> float:
    return min(LANE * (1.3 + len(lanes)), 0.6 * COLUMN)
