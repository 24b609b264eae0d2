"""A rig whose pivot is accelerated: seen from the pivot, gravity is shifted against the acceleration, exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.pivot import Pivot
from cmg_mj.features.pivot.pivot_signals import PivotSignals
from cmg_mj.features.pivot.pivot_track import MAX_RECORDED_M_S2, read_track
from cmg_mj.inputs.features import Judgement
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.plant import Plant, check_axis
from cmg_mj.plant.tilt_line import UP
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.schema import Scenario


def check_pivots(scenario: Scenario, plant: Plant) -> None:
    """Refuse motions that do not fit a plant.

    Raises:
        InputError: The plant lacks an axis, the pivot cannot be moved, or its track cannot be read.
    """
    pivots: list[Pivot] = scenario.section("pivot")
    for i, pivot in enumerate(pivots):
        if pivot.direction != "vertical" or pivot.axis is not None:
            check_axis(f"pivot.{i}.axis", pivot.axis, plant)
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
            largest = abs(pivot.scale) * abs(track.accelerations).max()
            if largest > MAX_RECORDED_M_S2:
                raise InputError(
                    f"pivot.{i}.scale = {pivot.scale:g}: {pivot.file} times this reaches {largest:.3g} m/s2; at most "
                    f"{MAX_RECORDED_M_S2:g}"
                )
    pivot_directions(plant, pivots)


def moving_pivot(
    pivots: Sequence[Pivot], plants: Sequence[Plant], seed: int, world_ids: int | Sequence[int]
) -> PivotSignals:
    """Make the acceleration of the pivot as a disturbance; a size may be an array (n_worlds,)."""
    directions, *_ = [pivot_directions(plant, pivots) for plant in dict.fromkeys(plants)]  # each plant is checked
    return PivotSignals(pivots, directions, seed, world_ids, plants[0].timestep)


def describe_pivots(design: Design, plant: Plant) -> Judgement:
    """Describe the motions of the pivot."""
    pivots: list[Pivot] = design.scenario.section("pivot")
    rows = []
    for pivot in pivots:
        rows.append(("pivot", pivot.words))
        if pivot.file is not None:
            rows.append(("", read_track(pivot.file, pivot.column).words))
    names = [f"pivot.{i}" for i, pivot in enumerate(pivots) if pivot.direction == "across" and np.any(pivot.size)]
    if not names or not plant.reduced.pivot_arm:
        return Judgement(rows)
    hint = (
        f"{', '.join(names)}: accelerates across what the pivot slides on, and moves the rig by no more than friction "
        'and damping there hand on; direction = "vertical" does move it'
    )
    return Judgement(rows, [hint])


def pivot_directions(plant: Plant, pivots: Sequence[Pivot]) -> list[list[float]]:
    """Find the directions in which a pivot is accelerated, and see that the rig may be.

    Args:
        plant: The rig.
        pivots: The motions; the axis of each is one of the rig's.

    Returns:
        A unit vector each, in the world's axes.

    Raises:
        InputError: The model has something that depends on gravity or on the air at rest.
    """
    if not pivots:
        return []
    model = plant.model
    if compensated := np.flatnonzero(model.body_gravcomp).tolist():
        raise InputError(
            f"pivot: {plant.path}: the body {model.body(compensated[0]).name!r} has gravcomp, which holds against "
            "gravity and not against the pivot's acceleration: such a rig's pivot cannot be moved"
        )
    if model.opt.density or model.opt.viscosity:
        raise InputError(
            f"pivot: {plant.path}: <option density, viscosity>: the air's drag depends on the pivot's velocity, which "
            "is not simulated: such a rig's pivot cannot be moved"
        )
    data = data_at_keyframe(model, plant.key)
    along = {}
    for axis in plant.axes:
        line = data.xmat[axis.frame].reshape(3, 3) @ axis.direction
        line[2] = 0.0  # it is horizontal, but for an inaccuracy
        along[axis.name] = line / np.linalg.norm(line)
    directions = []
    for pivot in pivots:
        line = along[pivot.axis or plant.axis.name]
        vectors = {"along": line, "across": np.cross(line, UP), "vertical": UP}
        directions.append((vectors[pivot.direction] + 0.0).tolist())
    return directions
