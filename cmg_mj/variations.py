"""How a rig differs from its model file: integrator and step, friction, imbalance, the equilibrium bias."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.plant_settings import PlantSettings
from cmg_mj.rig_parts import KEYFRAME

_INTEGRATORS = {
    "RK4": int(mujoco.mjtIntegrator.mjINT_RK4),
    "Euler": int(mujoco.mjtIntegrator.mjINT_EULER),
    "implicit": int(mujoco.mjtIntegrator.mjINT_IMPLICIT),
    "implicitfast": int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST),
    "discrete": int(mujoco.mjtIntegrator.mjINT_DISCRETE),
}


def vary(
    model: mujoco.MjModel,
    settings: PlantSettings,
    path: Path,
    *,
    tilt: int,
    gimbals: Sequence[int],
    flywheels: Sequence[int],
) -> None:
    """Change a compiled model as its settings say.

    Args:
        model: The model, as its file has it.
        settings: What is to differ; what is left out stays.
        path: The file, for messages.
        tilt: The tilt joint.
        gimbals: The gimbals' joints.
        flywheels: The flywheels' joints.

    Raises:
        InputError: The body that tilts has no mass of its own to move.
    """
    model.opt.integrator = _INTEGRATORS[settings.integrator]
    # A plant that diverges must say so, not start again from its reference pose.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    for field, joints, value in (
        (model.dof_armature, gimbals, settings.gimbal_armature_kg_m2),
        (model.dof_frictionloss, gimbals, settings.gimbal_friction_n_m),
        (model.dof_damping, gimbals, settings.gimbal_damping_n_m_s),
        (model.dof_frictionloss, [tilt], settings.tilt_friction_n_m),
        (model.dof_damping, [tilt], settings.tilt_damping_n_m_s),
    ):
        if value is not None:
            field[list(joints)] = value
    if settings.equilibrium_bias_deg:
        frame = int(model.jnt_bodyid[tilt])
        model.body_ipos[frame] += bias_shift(model, tilt, math.radians(settings.equilibrium_bias_deg), path)
    if settings.flywheel_imbalance_kg_m:
        for flywheel in flywheels:
            body = int(model.jnt_bodyid[flywheel])
            model.body_ipos[body, 0] += settings.flywheel_imbalance_kg_m / model.body_mass[body]
    mujoco.mj_setConst(model, mujoco.MjData(model))  # makes what follows from the centres of mass


def bias_shift(model: mujoco.MjModel, tilt: int, bias: float, path: Path) -> np.ndarray:
    """How far the frame's centre of mass moves so that the whole rig's turns about the pivot by e.

    The first moment of all that tilts is turned, not lengthened: gravity's torque keeps its amplitude.

    Args:
        model: The model, as its file has it.
        tilt: The tilt joint, which the frame hangs on.
        bias: e [rad].
        path: The model's file, for messages.

    Returns:
        The shift, (3,) [m].

    Raises:
        InputError: The frame has no mass of its own.
    """
    frame = int(model.jnt_bodyid[tilt])
    if model.body_mass[frame] <= 0.0:
        raise InputError(
            f"plant.equilibrium_bias_deg: {path}: the body with the joint 'tilt' needs a mass of its own to "
            "move (give the model's compiler fusestatic=\"true\", so that the cubes' halves become part of it)"
        )
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, KEYFRAME))
    mujoco.mj_forward(model, data)
    to_frame = data.xmat[frame].reshape(3, 3).T
    centre = to_frame @ (data.subtree_com[frame] - data.xanchor[tilt])
    c, s = math.cos(bias), math.sin(bias)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return model.body_subtreemass[frame] / model.body_mass[frame] * (turn @ centre - centre)
