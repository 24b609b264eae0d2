"""A rig whose pivot slides freely, linearised: from the command to the sensors, the tilt taken about the pivot."""

from __future__ import annotations

import mujoco

from cmg_mj.plant.axis import Axis
from cmg_mj.plant.linearisation import hold_bend, output_matrix, state_and_input
from cmg_mj.scenario.linear_plant import LinearPlant


def sliding_model(model: mujoco.MjModel, key: int, axis: Axis) -> LinearPlant:
    """Linearise a rig whose pivot slides, at its keyframe, with a rigid frame: `bend_model` has that which bends.

    Args:
        model: The compiled model.
        key: The keyframe at which it stands upright.
        axis: Its axis.

    Returns:
        The rig; its y1 is the tilt less the pivot's acceleration over g.
    """
    A, B = (hold_bend(model, key, matrix) for matrix in state_and_input(model, key, axis))
    return LinearPlant(A, B, output_matrix(model, key, axis, A, on_mast=False, height=0.0))
