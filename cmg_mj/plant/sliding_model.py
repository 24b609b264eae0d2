"""A rig whose pivot slides freely, linearised: from the command to the sensors, the tilt taken about the pivot."""

from __future__ import annotations

import mujoco
import numpy as np

from cmg_mj.plant.axis import Axis
from cmg_mj.plant.mujoco_state import at_keyframe
from cmg_mj.plant.step_limit import input_column, state_matrix
from cmg_mj.scenario.linear_rig import LinearRig

UP = np.array([0.0, 0.0, 1.0])


def sliding_model(model: mujoco.MjModel, key: int, axis: Axis) -> LinearRig:
    """Linearise a rig whose pivot slides, at its keyframe, with its servos and all friction but the dry.

    Args:
        model: The compiled model.
        key: The keyframe at which it stands upright.
        axis: Its axis.

    Returns:
        The rig; its y1 is the tilt less the pivot's acceleration over g.
    """
    nv = model.nv
    command = np.zeros(model.nu)
    for module in axis.modules:
        command[module.servo] = module.direction
    A, B = state_matrix(model, key), input_column(model, key, command)[:, None]
    tilt, gimbals = axis.line.motion(model, at_keyframe(model, key)), np.zeros(nv)
    for module in axis.modules:
        gimbals[module.gimbal_dof] = module.direction / len(axis.modules)
    at, rate, acceleration = np.eye(len(A))[:nv], np.eye(len(A))[nv : 2 * nv], A[nv : 2 * nv]
    y1 = tilt @ at - pivot_row(model, key, axis) @ acceleration / np.linalg.norm(model.opt.gravity)
    return LinearRig(A, B, np.array([y1, tilt @ acceleration, gimbals @ at, tilt @ rate, tilt @ rate]))


def pivot_row(model: mujoco.MjModel, key: int, axis: Axis) -> np.ndarray:
    """The pivot's velocity across the axis, to the side a positive tilt leans to, by the joints' rates: (nv,)."""
    data = at_keyframe(model, key)
    turn, slides = data.xmat[axis.frame].reshape(3, 3), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, slides, None, data.xpos[axis.frame] + turn @ axis.point, axis.frame)
    return np.cross(turn @ axis.direction, UP) @ slides
