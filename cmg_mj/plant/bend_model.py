"""A rig that bends, linearised: from the command to the sensors, as it is and as if its frame were rigid."""

from __future__ import annotations

import mujoco

from cmg_mj.plant.axis import Axis
from cmg_mj.plant.linearisation import hold_bend, output_matrix, state_and_input
from cmg_mj.scenario.linear_plant import BendModel, LinearPlant
from cmg_mj.scenario.plant_settings import PlantSettings


def bend_model(model: mujoco.MjModel, key: int, axis: Axis, settings: PlantSettings) -> BendModel | None:
    """Linearise a rig that bends at its keyframe.

    Args:
        model: The compiled model.
        key: The keyframe at which it stands upright.
        axis: Its axis, whose tilt estimate says about which point of a rig that slides y1 is taken.
        settings: The plant's settings.

    Returns:
        The rig; None if its frame is rigid.
    """
    if not settings.bends:
        return None
    A, B = state_and_input(model, key, axis)
    on_mast, height = settings.bend_beyond != "both", axis.radial_tilt.height
    rigs = [
        LinearPlant(A, B, output_matrix(model, key, axis, A, on_mast=on_mast, height=height))
        for A, B in ((A, B), (hold_bend(model, key, A), hold_bend(model, key, B)))
    ]
    return BendModel(settings.bend_frequency_hz, settings.bend_damping_ratio, *rigs)
