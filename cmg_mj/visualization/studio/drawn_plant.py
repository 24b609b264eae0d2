"""The rig with all that is only seen, and the physics of the rig without: what Studio draws and steps."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from cmg_mj.plant.plant import Plant

_OF_WHAT_IS_SEEN = ("_", "name", "geom", "mesh", "mat", "tex", "skin", "bvh", "body_geom", "body_bvh", "light", "cam")
"""What arrays are called that hold geoms and what hangs on their number."""

MUJOCO_LOOKS_ALONG = (90.0, -45.0)
LOOKED_AT_ALONG = (125.0, -20.0)
"""Where the camera looks at first, azimuth and elevation, unless the model file says it [deg]."""


def drawn_plant(plant: Plant) -> Plant:
    """The same rig on a model of its own, which has what is only seen as well.

    Args:
        plant: The rig.

    Returns:
        A rig whose steps are those of the first, bit for bit.
    """
    other = copy.copy(plant)
    other.model = copy.copy(plant.drawn_model)
    other.model.opt = plant.model.opt
    view = other.model.vis.global_
    if (view.azimuth, view.elevation) == MUJOCO_LOOKS_ALONG:
        view.azimuth, view.elevation = LOOKED_AT_ALONG
    copy_physics_numbers(other.model, plant.model)
    return other


def copy_physics_numbers(model: mujoco.MjModel, of: mujoco.MjModel) -> None:
    """Have a model with more geoms step as another of the same rig does: every physical number is the other's.

    Args:
        model: What is changed.
        of: The rig with its scenario's variations, without what is only seen.
    """
    model.stat.meaninertia = of.stat.meaninertia  # scales the constraint solver's tolerance
    for name in dir(of):
        theirs = None if name.startswith(_OF_WHAT_IS_SEEN) else getattr(of, name)
        if isinstance(theirs, np.ndarray) and theirs.shape == (ours := getattr(model, name)).shape:
            ours[:] = theirs
