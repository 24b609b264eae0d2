"""A rig whose pivot is accelerated: seen from the pivot, gravity is shifted against the acceleration, exactly."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.pivot.settings import Pivot
from cmg_mj.plant.mujoco_state import at_keyframe
from cmg_mj.plant.plant import Plant
from cmg_mj.plant.tilt_line import UP


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
    refuse_other_forces(plant)
    data = at_keyframe(plant.model, plant.key)
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


def refuse_other_forces(plant: Plant) -> None:
    """Refuse a model on which an acceleration of the pivot is not a shift of gravity alone.

    Raises:
        InputError: It has gravcomp, or drag in the air.
    """
    model = plant.model
    compensated = np.flatnonzero(model.body_gravcomp)
    if len(compensated):
        name = model.body(int(compensated[0])).name
        raise InputError(
            f"pivot: {plant.path}: the body {name!r} has gravcomp, which holds against gravity and not against the "
            "pivot's acceleration: such a rig's pivot cannot be moved"
        )
    if model.opt.density or model.opt.viscosity:
        raise InputError(
            f"pivot: {plant.path}: <option density, viscosity>: the air's drag depends on the pivot's velocity, which "
            "is not simulated: such a rig's pivot cannot be moved"
        )


def with_own_model(plant: Plant) -> Plant:
    """Copy a plant onto a model of its own, whose gravity may be shifted while it runs."""
    other = copy.copy(plant)
    other.model = copy.copy(plant.model)
    return other
