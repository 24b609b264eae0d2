"""How a recording opens: which views are where, and which observers are switched on."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from cmg_mj.plant.plant import Plant
from cmg_mj.visualization.plots.readability import FEW
from cmg_mj.visualization.recording.run import best_observers, best_runs
from cmg_mj.visualization.recording.scene import FLYWHEEL_SLOWDOWN
from cmg_mj.visualization.recording.signals import Branch
from cmg_mj.visualization.recording.timeline import TIMELINE
from cmg_mj.visualization.recording.views import Choice, Plot, overlay, pages, phases, plot, rig

ESTIMATE_PLOTS = (
    Plot("Tilt rate [rad/s]", ("rate/", "rate_estimate/"), 2.8),
    Plot("Estimation error of the tilt rate [rad/s]", ("rate_error/",), 2.8),
)
TILT_PLOTS = (Plot("Tilt [deg]", ("tilt/",), 1.7), *ESTIMATE_PLOTS)
BIAS_PLOT = Plot("Estimated equilibrium bias [deg]", ("bias/",), 1.3)
"""Only where an observer estimates it."""
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
    Plot("Gimbal angle of {cube} from upright [deg]", ("gimbal/{cube}",)),
    Plot("Integrator [rad s]", ("integrator/x_e",)),
)

LANE, COLUMN = 40.0, 820.0
"""Height of a lane of phases and of a column of plots [pixels]."""

ALL = "All observers"


def default_blueprint(plant: Plant, branches: Sequence[Branch], *, live: bool = False) -> rrb.Blueprint:
    """Lay out a recording.

    Args:
        plant: The rig.
        branches: The runs.
        live: Whether the viewer shows what comes last, and not all of it from the beginning.

    Returns:
        A dashboard for one run; for several, one that compares them, and a tab for each. Of more than a few observers
        the best are switched on, and another tab has all of them.
    """
    names = _page_names(branches)
    boards = [_dashboard(branch, names) for branch in branches]
    if len(branches) > 1:
        boards = [*_comparison(plant, branches), *boards]
    elif len(branches[0].run.observers) > FEW:
        boards.append(_all_riding_along(branches[0]))
    return rrb.Blueprint(
        rrb.Tabs(*boards, active_tab=0) if len(boards) > 1 else boards[0],
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following" if live else "playing"),
        auto_views=False,
        auto_layout=False,
    )


def _dashboard(branch: Branch, names: Sequence[str]) -> rrb.Container:
    """Everything about one run."""
    tilt = (*TILT_PLOTS, BIAS_PLOT) if _has_bias(branch) else TILT_PLOTS
    mechanism = rig(branch, f"Rig (flywheels drawn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed)")
    return _columns(
        branch.label,
        [9, 8, 6],
        rrb.Vertical(
            mechanism, pages(names, "Observers" if branch.run.open_loop_observers else "Summary"), row_shares=[1, 1]
        ),
        _below_lanes([branch], tilt, [plot(what, branch, _best_of(what, branch)) for what in tilt]),
        _stack(ACTUATOR_PLOTS, [plot(what, branch, _best_of(what, branch)) for what in ACTUATOR_PLOTS]),
    )


def _all_riding_along(branch: Branch) -> rrb.Container:
    """What every observer of a run says, each to be switched on in the legend."""
    rates = [plot(what, branch, _best_of(what, branch, listed=True)) for what in ESTIMATE_PLOTS]
    bias = [plot(BIAS_PLOT, branch, _best_of(BIAS_PLOT, branch, listed=True))] if _has_bias(branch) else []
    return _columns(ALL, [3, 2], rrb.Vertical(*rates), rrb.Vertical(*bias, pages(_page_names([branch]), "Observers")))


def _comparison(plant: Plant, branches: Sequence[Branch]) -> list[rrb.Container]:
    """The best runs over each other, then, if there are more, all of them."""
    few = best_runs([branch.run for branch in branches])
    cube = plant.cubes[0].of_axis
    shown = [branch for branch in branches if branch.run.name in few]
    tilt = [overlay(what, branches, cube, Choice(few)) for what in COMPARED_TILT_PLOTS]
    actuators = [overlay(what, branches, cube, Choice(few)) for what in COMPARED_ACTUATOR_PLOTS]
    rigs = rrb.Tabs(*(rig(branch, branch.label) for branch in shown), active_tab=0)
    names = _page_names(branches)
    board = _columns(
        "Comparison" if branches[0].run.axis is None else "All axes",
        [9, 8, 6],
        rrb.Vertical(rigs, pages(names, "Summary"), row_shares=[1, 1]),
        _below_lanes(shown, COMPARED_TILT_PLOTS, tilt),
        _stack(COMPARED_ACTUATOR_PLOTS, actuators),
    )
    if len(shown) == len(branches):
        return [board]
    any_of_them = Choice(few, listed=True)
    lanes = _lanes_height(branches)
    more = _columns(
        ALL,
        [9, 8, 6],
        rrb.Vertical(phases(branches), pages(names, "Summary"), row_shares=[lanes, COLUMN - lanes]),
        rrb.Vertical(*(overlay(what, branches, cube, any_of_them) for what in COMPARED_TILT_PLOTS)),
        rrb.Vertical(*(overlay(what, branches, cube, any_of_them) for what in COMPARED_ACTUATOR_PLOTS[:2])),
    )
    return [board, more]


def _best_of(what: Plot, branch: Branch, *, listed: bool = False) -> Choice:
    """The best of those that have a line in a plot."""
    there = {row.observer for path, row in branch.series.items() if path.startswith(what.entities)}
    return Choice(best_observers(branch.run, there), listed)


def _has_bias(branch: Branch) -> bool:
    return any(path.startswith("bias/") for path in branch.series)


def _page_names(branches: Sequence[Branch]) -> list[str]:
    """The pages there are."""
    riding = len(branches) == 1 or any(branch.run.open_loop_observers for branch in branches)
    return ["Summary", *(["Observers"] if riding else []), "Scenario"]


def _columns(name: str, shares: list[float], *columns: rrb.Container | rrb.View) -> rrb.Container:
    return rrb.Horizontal(*columns, column_shares=shares, name=name)


def _stack(plots: Sequence[Plot], views: Sequence[rrb.View]) -> rrb.Container:
    """Plots below each other."""
    return rrb.Vertical(*views, row_shares=[what.height for what in plots])


def _below_lanes(lanes: Sequence[Branch], plots: Sequence[Plot], views: Sequence[rrb.View]) -> rrb.Container:
    """Plots below each other, and the lanes of phases above them."""
    top = _lanes_height(lanes)
    share = (COLUMN - top) / sum(what.height for what in plots)
    return rrb.Vertical(phases(lanes), *views, row_shares=[top, *(what.height * share for what in plots)])


def _lanes_height(lanes: Sequence[Branch]) -> float:
    return min(LANE * (1.3 + len(lanes)), 0.6 * COLUMN)
