"""The views of a recording: plots of one run or of several, the mechanism, lanes of phases, pages of text."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.visualization.plots.colours import Colour
from cmg_mj.visualization.plots.readability import (
    axis_range,
    error_range,
    free_corner,
    is_seen,
    stretched,
    with_scale,
)
from cmg_mj.visualization.recording.branch import Branch
from cmg_mj.visualization.recording.run import ENDINGS
from cmg_mj.visualization.recording.signals import Lines, Series

RATE, RATE_ERROR = "rate/true", "rate_error/"
"""Errors are drawn to the scale of the rate: a small axis would make a small error look large."""

Override = rr.SeriesLines | rrb.EntityBehavior
PlayState = Literal["paused", "playing", "following"]


@dataclass(frozen=True)
class Plot:
    """A plot of time series.

    Attributes:
        title: Quantity and unit.
        entities: Paths below the run's branch, folders with their slash.
        height: Share of the column's height.
        least: Least span of the axis, in the unit of the title.
        points: Height of the plot in a window of common size, without its title and time axis [points].
    """

    title: str
    entities: tuple[str, ...]
    height: float = 1.0
    least: float = 0.0
    points: float = 200.0


@dataclass(frozen=True)
class Choice:
    """The observers, or runs, that are switched on. The axes fit them.

    Attributes:
        names: Names of the observers or runs.
        full_legend: Whether the legend has the others too, where a click switches them on. Otherwise the list of the
            view's entities has them.
    """

    names: Collection[str]
    full_legend: bool = False

    def visibility(self, name: str) -> list[Override]:
        """Return the overrides that switch the line of an observer or run on or off."""
        visible = name in self.names
        return [rr.SeriesLines(visible_series=[visible]) if self.full_legend else rrb.EntityBehavior(visible=visible)]

    def style_line(self, name: str, color: Colour, label: str) -> list[Override]:
        """Return the overrides that style the line of a run and switch it on or off."""
        visible_series = [name in self.names] if self.full_legend else None
        style = rr.SeriesLines(visible_series=visible_series, colors=[color], names=[label], widths=[1.5])
        return [style] if self.full_legend else [*self.visibility(name), style]


EYE = (1.48, -1.65, 0.63)
"""Vector from the rig's centre to the camera, in radii of the rig: a square view holds all of the rig."""

BACKGROUND = (58, 63, 71)


def plot_view(plot: Plot, branch: Lines, observers: Choice) -> rrb.View:
    """Lay out a plot of one run or log, with all its observers, some of them switched off."""
    rows = [row for path, row in branch.series.items() if path.startswith(plot.entities)]
    visible = [row for row in rows if not row.observer or row.observer in observers.names]
    ranges = _Ranges()
    for row in visible:
        ranges.add(row, branch.falls_from)
    if RATE_ERROR in plot.entities:
        ranges.add_rate(branch.series[RATE], branch.falls_from)
    axis = ranges.axis(plot)
    overrides: dict[str, list[Override]] = {}
    for row in rows:
        if row not in visible:
            overrides[f"{branch.path}/{row.path}"] = observers.visibility(row.observer)
        elif len(row.time) and not is_seen(row.values, axis):  # the legend would name a line that is not there
            overrides[f"{branch.path}/{row.path}"] = [rrb.EntityBehavior(visible=False)]
    contents = [f"{branch.path}/{entity}**" for entity in plot.entities]
    return _series_view(plot, branch.path, contents, overrides, axis, visible)


def overlay_view(plot: Plot, branches: Sequence[Branch], module: str, runs: Choice) -> rrb.View:
    """Lay out a plot of the same series of all runs, each in its run's colour.

    Args:
        plot: The plot; `{module}` in title and entities stands for the name of a module.
        branches: The runs.
        module: Name of the module.
        runs: The runs that are switched on.

    Returns:
        The view.
    """
    part = rr.escape_entity_path_part(module)
    overrides: dict[str, list[Override]] = {}
    visible = []
    stands = any(branch.run.name in runs.names and branch.run.outcome.kind not in ENDINGS for branch in branches)
    ranges = _Ranges()
    for branch in branches:
        name = branch.run.name
        row = _row(branch, plot.entities[0].format(module=part))
        overrides[f"{branch.path}/{row.path}"] = runs.style_line(name, branch.entry.color, branch.label)
        if name in runs.names:
            visible.append(row)
            is_optional = stands and branch.run.outcome.kind in ENDINGS
            ranges.add(replace(row, whole=row.whole and not is_optional), branch.falls_from)
            if RATE_ERROR in plot.entities and not is_optional:
                ranges.add_rate(branch.series[RATE], branch.falls_from)
    plot = replace(plot, title=plot.title.format(module=module))
    return _series_view(plot, "/", list(overrides), overrides, ranges.axis(plot), visible)


class _Ranges:
    """The values that decide about the axis of a plot: those that it must show, those that it may cut off, falls."""

    def __init__(self) -> None:
        self._required: list[np.ndarray] = []
        self._optional: list[np.ndarray] = []
        self._falls: list[np.ndarray] = []
        self._rates: list[np.ndarray] = []

    def add(self, row: Series, falls_from: float) -> None:
        """Add a series of a run that only fell from some time on [s]."""
        before = row.time <= falls_from
        (self._required if row.whole else self._optional).append(row.values[before])
        if row.whole:
            self._falls.append(row.values[~before])

    def add_rate(self, row: Series, falls_from: float) -> None:
        """Add a true rate, to whose scale errors are drawn."""
        self._rates.append(row.values[row.time <= falls_from])

    def axis(self, plot: Plot) -> tuple[float, float] | None:
        """Choose the range of the axis."""
        if self._rates:
            axis = error_range(self._rates, [*self._required, *self._optional])
        else:
            axis = stretched(axis_range(self._required, self._optional), self._falls)
        if axis is None:
            return None
        more = max(0.0, plot.least - (axis[1] - axis[0])) / 2.0
        return with_scale((axis[0] - more, axis[1] + more), plot.points)


def _row(branch: Branch, entity: str) -> Series:
    """Find a series; in a folder, the series of the observer in the loop."""
    observers = ("", branch.run.trajectory.observers[0])
    return next(row for path, row in branch.series.items() if path.startswith(entity) and row.observer in observers)


def _series_view(
    plot: Plot,
    origin: str,
    contents: list[str],
    overrides: Mapping[str, list[Override]],
    axis: tuple[float, float] | None,
    visible: Sequence[Series],
) -> rrb.View:
    corner = "".join(word.capitalize() for word in free_corner([(row.time, row.values) for row in visible], axis))
    return rrb.TimeSeriesView(
        origin=origin,
        contents=contents,
        name=plot.title,
        overrides={**overrides},
        axis_x=_time_axis(),
        axis_y=rrb.ScalarAxis(range=axis) if axis else None,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.auto(corner), visible=True),
    )


def mechanism_view(branch: Branch, name: str) -> rrb.View:
    """Lay out the moving mechanism, all of it in view."""
    centre = branch.ball.centre
    eye = centre + branch.ball.radius * np.array(EYE)
    return rrb.Spatial3DView(
        origin=f"{branch.path}/rig",
        name=name,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=centre, eye_up=(0.0, 0.0, 1.0)),
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
