"""Coupling of the axes by a turn about the vertical, which sweeps the momenta of an axis' wheels and tilt round."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from cmg_mj.plant.axis import Axis
from cmg_mj.plant.elements import Module, subtree
from cmg_mj.plant.inertia import wheel_momentum
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.tilt_line import UP
from cmg_mj.stages.turning import YawCoupling


def turning(model: mujoco.MjModel, key: int, axes: Sequence[Axis]) -> YawCoupling:
    """Compute the coupling of the axes in a turn about the vertical.

    Args:
        model: The compiled model.
        key: The keyframe at which the rig stands upright.
        axes: Its axes.

    Returns:
        The coefficients, from the wheels' axes and speeds and the masses as the model has them.
    """
    data = data_at_keyframe(model, key)
    along = [data.xmat[axis.frame].reshape(3, 3) @ axis.direction for axis in axes]
    swept = [sum((_turned(model, data, module) for module in axis.modules), np.zeros(3)) for axis in axes]
    pushes = [n @ s for n, s in zip(along, swept, strict=True)]
    rows = [(n, push, _inertia(model, data, axis)) for n, push, axis in zip(along, pushes, axes, strict=True)]
    wheels = [[-(n @ np.cross(UP, s)) / push for s in swept] for n, push, _ in rows]
    body = [
        [(n @ about @ n + m @ about @ m - UP @ about @ UP) * (n @ np.cross(m, UP)) / push for m in along]
        for n, push, about in rows
    ]
    coriolis = [[2.0 * (n @ np.cross(UP, m)) for m in along] for n, _, _ in rows]
    return YawCoupling(*(np.array(rows).tolist() for rows in (wheels, body, coriolis)))


def _turned(model: mujoco.MjModel, data: mujoco.MjData, module: Module) -> np.ndarray:
    """Return the derivative of a wheel's momentum by x3 at x3 = 0, in the world (3,) [N m s]."""
    momentum = wheel_momentum(model, data, module.flywheel_dof, module.speed)
    return module.direction * np.cross(data.xaxis[model.dof_jntid[module.gimbal_dof]], momentum)


def _inertia(model: mujoco.MjModel, data: mujoco.MjData, axis: Axis) -> np.ndarray:
    """Return the inertia of all that tilts about a point of the line, in the world (3, 3) [kg m^2]."""
    pivot = data.xpos[axis.frame] + data.xmat[axis.frame].reshape(3, 3) @ axis.point
    inertia = np.zeros((3, 3))
    for body in subtree(model, model.jnt_bodyid[axis.line.joint]):
        axes, arm = data.ximat[body].reshape(3, 3), data.xipos[body] - pivot
        inertia += axes @ np.diag(model.body_inertia[body]) @ axes.T
        inertia += model.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return inertia
