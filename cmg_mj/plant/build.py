"""The plant of a scenario: on the grid of its times, with the axes that the scenario names."""

from __future__ import annotations

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.features.pivot.moving_pivot import pivot_directions
from cmg_mj.features.pivot.pivot_track import MOST_RECORDED_M_S2, read_track
from cmg_mj.inputs.files import folder
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.scenario.schema import Scenario
from cmg_mj.scenario.time_grid import TimeGrid, time_grid


def load_scenario_plant(scenario: Scenario, like: Plant | None = None) -> Plant:
    """Load a scenario's plant.

    Args:
        scenario: The scenario.
        like: A plant that may be of the same model file, which then is not compiled again.

    Raises:
        InputError: The scenario's times fit no physics step, or `load_plant` refuses the plant; the scenario is named.
    """
    with scenario.named_in_errors():
        return plant_on_grid(scenario, time_grid(scenario), like)


def plant_on_grid(scenario: Scenario, grid: TimeGrid, like: Plant | None = None) -> Plant:
    """Load a scenario's plant, whose physics steps fill the times of a grid: see `load_scenario_plant`."""
    settings, of_axes = scenario.plant, {name: part.plant for name, part in scenario.of_axes.items()}
    if like is not None and like.is_of_same_file(settings):
        return like.changed(settings, grid, of_axes)
    plant = load_plant(settings, grid=grid, of_axes=of_axes)
    if plant.path.resolve().parent != folder("models").resolve():
        _ = plant.drawn_model  # a mesh that cannot be read is found before a run and not after it
    return plant


def check_scenario(scenario: Scenario, plant: Plant) -> None:
    """Refuse a scenario that does not fit a plant.

    Raises:
        InputError: The plant lacks an axis, the pivot cannot be moved, or its track cannot be read.
    """
    check_axes(scenario, plant)
    for i, pivot in enumerate(scenario.pivot):
        if pivot.axis in plant.settings.locked_axes:
            raise InputError(
                f"pivot.{i}.axis = {pivot.axis!r}: is locked, and gives no direction; name one of "
                f"{', '.join(plant.axis_names)}"
            )
        if pivot.file is not None:
            try:
                track = read_track(pivot.file, pivot.column)
            except InputError as error:
                raise InputError(f"pivot.{i}.file: {error}") from error
            largest = abs(pivot.scale) * float(abs(track.accelerations).max())
            if largest > MOST_RECORDED_M_S2:
                raise InputError(
                    f"pivot.{i}.scale = {pivot.scale:g}: {pivot.file} times this reaches {largest:.3g} m/s2; at most "
                    f"{MOST_RECORDED_M_S2:g}"
                )
    pivot_directions(plant, scenario.pivot)


def check_axes(scenario: Scenario, plant: Plant) -> None:
    """Refuse the name of an axis that the plant does not have, and on a plant of several axes a push without one.

    Raises:
        InputError: There is such a name, or such a push.
    """
    known = [*plant.axis_names, *plant.settings.locked_axes]
    for name in scenario.axes:
        if known == [""]:
            raise InputError(f"axes.{name}: the rig has one axis, without a name; set its values in [plant], ...")
        if name not in known:
            raise InputError(f"axes.{name}: the rig has no such axis; {nearest(name, known)}")
    torques = [(f"push.{i}.axis", push.axis) for i, push in enumerate(scenario.push)]
    torques += [(f"swing.{i}.axis", swing.axis) for i, swing in enumerate(scenario.swing)]
    for i, pivot in enumerate(scenario.pivot):
        if pivot.direction != "vertical" or pivot.axis is not None:
            torques.append((f"pivot.{i}.axis", pivot.axis))
    for field, axis in torques:
        if axis is None and len(known) > 1:
            raise InputError(f"{field}: the rig has several axes: which of {', '.join(known)}?")
        if axis is not None and known == [""]:
            raise InputError(f"{field} = {axis!r}: the rig has one axis, without a name; leave it out")
        if axis is not None and axis not in known:
            raise InputError(f"{field} = {axis!r}: the rig has no such axis; {nearest(axis, known)}")
