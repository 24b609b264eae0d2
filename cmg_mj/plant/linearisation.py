"""A rig linearised at its keyframe: from the command of its gimbals to what its sensors show."""

from __future__ import annotations

import mujoco
import numpy as np

from cmg_mj.plant.axis import Axis, pivot_rows
from cmg_mj.plant.mujoco_state import at_keyframe
from cmg_mj.plant.parts import BEND_JOINT, element_id
from cmg_mj.plant.step_limit import input_column, state_matrix


def state_and_input(model: mujoco.MjModel, key: int, axis: Axis) -> tuple[np.ndarray, np.ndarray]:
    """Linearise a rig, with its servos and all friction but the dry.

    Args:
        model: The compiled model.
        key: The keyframe at which it stands upright.
        axis: Its axis.

    Returns:
        A of `state_matrix`, (n, n), and B of the axis' command, (n, 1).
    """
    command = np.zeros(model.nu)
    for module in axis.modules:
        command[module.servo] = module.direction
    return state_matrix(model, key), input_column(model, key, command)[:, None]


def hold_bend(model: mujoco.MjModel, key: int, matrix: np.ndarray) -> np.ndarray:
    """Hold the bend in a state or input matrix: a torque there takes its acceleration away.

    Args:
        model: The compiled model; without a bend nothing changes.
        key: The keyframe.
        matrix: A, (n, n), or B, (n, 1).

    Returns:
        The matrix of the rigid rig, in the same states.
    """
    joint = element_id(model, "joint", BEND_JOINT)
    if joint < 0:
        return matrix
    bend, nv, data = int(model.jnt_dofadr[joint]), model.nv, at_keyframe(model, key)
    unit, gives = np.zeros((1, nv)), np.zeros((1, nv))
    unit[0, bend] = 1.0
    mujoco.mj_solveM(model, data, gives, unit)
    rigid = matrix.copy()
    rigid[nv : 2 * nv] -= np.outer(gives[0] / gives[0, bend], matrix[nv + bend])
    rigid[bend] = rigid[nv + bend] = 0.0
    if rigid.shape[1] == len(rigid):
        rigid[:, [bend, nv + bend]] = 0.0
    return rigid


def output_matrix(
    model: mujoco.MjModel, key: int, axis: Axis, A: np.ndarray, *, on_mast: bool, height: float
) -> np.ndarray:
    """Compute C in the order of `Response`: the sensors turn with the modules, or with the bend besides.

    A pivot that slides is accelerated by the rig: y1 is the tilt less the acceleration of the point that the tilt
    estimate takes to be at rest, over g.

    Args:
        model: The compiled model.
        key: The keyframe.
        axis: Its axis.
        A: The state matrix, (n, n), whose rows of the rates give accelerations.
        on_mast: Whether the bend lies between modules and sensors.
        height: Height of that point above the pivot [m].

    Returns:
        C, (5, n).
    """
    nv = model.nv
    angle, rate, acceleration = np.eye(len(A))[:nv], np.eye(len(A))[nv : 2 * nv], A[nv : 2 * nv]
    modules = axis.line.motion(model, at_keyframe(model, key))
    sensors, gimbals = modules.copy(), np.zeros(nv)
    if on_mast:
        sensors[int(model.joint(BEND_JOINT).dofadr[0])] = 1.0
    for module in axis.modules:
        gimbals[module.gimbal_dof] = module.direction / len(axis.modules)
    y1 = sensors @ angle
    if axis.reduced.pivot_arm:
        across, _ = pivot_rows(model, key, axis)
        y1 = y1 - (across + height * sensors) @ acceleration / np.linalg.norm(model.opt.gravity)
    return np.array([y1, sensors @ acceleration, gimbals @ angle, modules @ rate, sensors @ rate])
