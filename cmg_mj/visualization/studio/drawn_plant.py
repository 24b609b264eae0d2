"""A plant for Studio: the model with its visual geoms, and the physical numbers of the model without them."""

from __future__ import annotations

import copy

import mujoco

from cmg_mj.plant.plant import Plant

PHYSICS_ARRAYS = (
    "actuator_acc0",
    "actuator_biasprm",
    "actuator_gainprm",
    "body_inertia",
    "body_invweight0",
    "body_ipos",
    "body_iquat",
    "body_mass",
    "body_sameframe",
    "body_simple",
    "body_subtreemass",
    "dof_M0",
    "dof_armature",
    "dof_damping",
    "dof_frictionloss",
    "dof_invweight0",
    "dof_length",
    "dof_simplenum",
    "key_ctrl",
    "key_qvel",
    "site_pos",
    "site_sameframe",
    "tendon_invweight0",
)
"""Arrays of a model that `plant.variations` changes or `mj_setConst` derives from them; none is indexed by geoms."""

MUJOCO_VIEW = (90.0, -45.0)
STUDIO_VIEW = (125.0, -20.0)
"""Azimuth and elevation of the first view, unless the model file gives another than MuJoCo's default [deg]."""


def drawn_plant(plant: Plant) -> Plant:
    """Copy a plant onto a model of its own that has the visual geoms as well.

    Args:
        plant: The plant.

    Returns:
        A plant whose steps equal those of the first bit for bit.
    """
    other = copy.copy(plant)
    other.model = copy.copy(plant.drawn_model)
    other.model.opt = plant.model.opt
    view = other.model.vis.global_
    if (view.azimuth, view.elevation) == MUJOCO_VIEW:
        view.azimuth, view.elevation = STUDIO_VIEW
    copy_physics_numbers(other.model, plant.model)
    return other


def copy_physics_numbers(model: mujoco.MjModel, reference: mujoco.MjModel) -> None:
    """Make a model with more geoms step as another model of the same plant does.

    Args:
        model: The model to change.
        reference: The plant with its scenario's variations, without visual geoms.
    """
    model.stat.meaninertia = reference.stat.meaninertia  # scales the constraint solver's tolerance
    for name in PHYSICS_ARRAYS:
        getattr(model, name)[:] = getattr(reference, name)
