"""The single views of a recording: plots of one run or of several, the rig, the lanes of phases, the pages."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.visualization.plots.colours import colours
from cmg_mj.visualization.plots.readability import axis_range, free_corner
from cmg_mj.visualization.recording.run import ENDINGS
from cmg_mj.visualization.recording.signals import Branch, Lines, Series

RATE, RATE_ERROR = "rate/true", "rate_error/"
"""An error is drawn to the scale of the rate: it must not look small because its axis is large."""


@dataclass(frozen=True)
class Plot:
    """One plot.

    Attributes:
        title: What it shows and in which unit.
        entities: Paths below the run's branch, folders with their slash.
        height: Share of its column.
        least: Least span of its axis, in its unit.
    """

    title: str
    entities: tuple[str, ...]
    height: float = 1.0
    least: float = 0.0


@dataclass(frozen=True)
class Choice:
    """Which observers, or runs, are switched on. The axes fit those.

    Attributes:
        shown: Those.
        listed: Whether the others stand in the legend too, where a click switches them on. Otherwise they are found
            with the view's entities.
    """

    shown: Collection[str]
    listed: bool = False

    def line(self, name: str, **looks: Any) -> list[Any]:
        """What to override of a line, by the name of its observer or run: its looks, and whether it is on."""
        on = name in self.shown
        if self.listed:
            return [rr.SeriesLines(visible_series=[on], **looks)]
        return [rrb.EntityBehavior(visible=on), *([rr.SeriesLines(**looks)] if looks else [])]


EYE = (1.48, -1.65, 0.63)
"""From the rig's centre to the camera, in radii of the rig: far enough for all of it in a square view."""

BACKGROUND = (58, 63, 71)


def plot(what: Plot, branch: Lines, observers: Choice) -> rrb.View:
    """A plot of one run, or one log.

    Args:
        what: The plot.
        branch: The run or log.
        observers: The others are there, but switched off.

    Returns:
        The view.
    """
    rows = [row for path, row in branch.series.items() if path.startswith(what.entities)]
    fitting = [row for row in rows if not row.observer or row.observer in observers.shown]
    sure = [row.values for row in fitting if row.whole]
    if RATE_ERROR in what.entities:
        sure.append(branch.series[RATE].values)
    return _series_view(
        what,
        branch.path,
        [f"{branch.path}/{entity}**" for entity in what.entities],
        {f"{branch.path}/{row.path}": observers.line(row.observer) for row in rows if row not in fitting},
        axis_range(sure, [row.values for row in fitting if not row.whole]),
        fitting,
    )


def overlay(what: Plot, branches: Sequence[Branch], cube: str, runs: Choice) -> rrb.View:
    """The same series of all runs, each in its run's colour.

    Args:
        what: The plot; `{cube}` in it stands for the name of a cube.
        branches: The runs.
        cube: That name.
        runs: The others are there, but switched off.

    Returns:
        The view.
    """
    color = colours(branch.run.name for branch in branches)
    part = rr.escape_entity_path_part(cube)
    overrides: dict[str, list[Any]] = {}
    sure: list[np.ndarray] = []
    rather: list[np.ndarray] = []
    fitting = []
    for branch in branches:
        name = branch.run.name
        row = _row(branch, what.entities[0].format(cube=part))
        looks = {"colors": [color[name]], "names": [branch.label], "widths": [1.5]}
        overrides[f"{branch.path}/{row.path}"] = runs.line(name, **looks)
        stands = branch.run.outcome.kind not in ENDINGS
        if name in runs.shown:
            fitting.append(row)
            (sure if row.whole and stands else rather).append(row.values)
            if RATE_ERROR in what.entities and stands:
                sure.append(branch.series[RATE].values)
    what = replace(what, title=what.title.format(cube=cube))
    return _series_view(what, "/", list(overrides), overrides, axis_range(sure, rather), fitting)


def _row(branch: Branch, entity: str) -> Series:
    """A series; of a folder, that of the observer in the loop."""
    in_loop = branch.run.trajectory.observers[0]
    found = (row for path, row in branch.series.items() if path.startswith(entity) and row.observer in ("", in_loop))
    return next(found)


def _series_view(
    what: Plot,
    origin: str,
    contents: list[str],
    overrides: Mapping[Any, list[Any]],
    axis: tuple[float, float] | None,
    shown: Sequence[Series],
) -> rrb.View:
    if axis is not None:
        more = max(0.0, what.least - (axis[1] - axis[0])) / 2.0
        axis = (axis[0] - more, axis[1] + more)
    corner = "".join(word.capitalize() for word in free_corner([(row.time, row.values) for row in shown], axis))
    return rrb.TimeSeriesView(
        origin=origin,
        contents=contents,
        name=what.title,
        overrides=overrides,
        axis_x=_time_axis(),
        axis_y=rrb.ScalarAxis(range=axis) if axis else None,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.auto(corner), visible=True),
    )


def rig(branch: Branch, name: str) -> rrb.View:
    """The moving mechanism, all of it in view.

    Args:
        branch: The run.
        name: The view's title.

    Returns:
        The view.
    """
    centre = branch.rig.centre
    eye = centre + branch.rig.radius * np.array(EYE)
    return rrb.Spatial3DView(
        origin=f"{branch.path}/rig",
        name=name,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=centre, eye_up=(0.0, 0.0, 1.0)),
        line_grid=False,
        background=rrb.Background(color=BACKGROUND),
    )


def phases(branches: Iterable[Branch]) -> rrb.View:
    """A lane of phases a run."""
    contents = [f"{branch.path}/phase" for branch in branches]
    return rrb.StateTimelineView(origin="/", contents=contents, name="Phase", time_view=_time_axis())


def pages(names: Sequence[str], active: str) -> rrb.Container:
    """Pages of text, one of them in front: `Summary` is `/summary`."""
    views = [rrb.TextDocumentView(origin=f"/{name.lower()}", name=name) for name in names]
    return rrb.Tabs(*views, active_tab=list(names).index(active))


def _time_axis() -> rrb.TimeAxis:
    return rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal)
