"""What a turn about the vertical couples: the momentum that one axis' gimbals have turned down is swept round."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from cmg_mj.axis import Axis
from cmg_mj.felt_inertia import at_keyframe
from cmg_mj.rig_parts import Cube

UP = np.array([0.0, 0.0, 1.0])


def coupling(model: mujoco.MjModel, key: int, axes: Sequence[Axis]) -> np.ndarray:
    """By how much each axis' gimbals must turn against the other axes' momentum while the rig turns.

    The wheels of axis j have, their gimbals at x3_j, the momentum s_j sin(x3_j) along the horizontal, where
    s_j = sum over its cubes of direction (gimbal axis x momentum at x3 = 0); what is left of it along the vertical is
    turned by nothing. In a frame that turns at w about the vertical z it changes by

        s_j cos(x3_j) u_j + w (z x s_j) sin(x3_j),

    and the frame gets the opposite torque. Of that about axis i, along n_i, nothing is left with

        u_i = w sum_j c_ij sin(x3_j) / cos(x3_i),   c_ij = -n_i . (z x s_j) / (n_i . s_i).

    Args:
        model: The compiled model.
        key: The keyframe at which the rig stands upright.
        axes: Its axes.

    Returns:
        c, (n_axes, n_axes) [1]: for two axes at right angles whose pairs are alike +-1 beside a diagonal of zeros.
    """
    data = at_keyframe(model, key)
    along = [data.xmat[axis.frame].reshape(3, 3) @ axis.direction for axis in axes]
    swept = [sum((_turned(model, data, cube) for cube in axis.cubes), np.zeros(3)) for axis in axes]
    rows = [[-float(n @ np.cross(UP, s)) / float(n @ own) for s in swept] for n, own in zip(along, swept, strict=True)]
    return np.array(rows)


def _turned(model: mujoco.MjModel, data: mujoco.MjData, cube: Cube) -> np.ndarray:
    """How a wheel's momentum changes with x3 at x3 = 0, in the world (3,) [N m s]."""
    gimbal, wheel = int(model.dof_jntid[cube.gimbal_dof]), int(model.dof_jntid[cube.flywheel_dof])
    body = int(model.jnt_bodyid[wheel])
    shares = data.ximat[body].reshape(3, 3).T @ data.xaxis[wheel]  # of the principal inertias
    momentum = float(model.body_inertia[body] @ shares**2) * cube.speed * data.xaxis[wheel]
    return cube.direction * np.cross(data.xaxis[gimbal], momentum)
