"""A rig that bends, linearised: from the command to the sensors, as it is and as if its frame were rigid."""

from __future__ import annotations

import mujoco
import numpy as np

from cmg_mj.plant.axis import Axis
from cmg_mj.plant.parts import BEND_JOINT
from cmg_mj.plant.step_limit import input_column, state_matrix
from cmg_mj.scenario.linear_rig import BendModel, LinearRig
from cmg_mj.scenario.plant_settings import PlantSettings


def bend_model(model: mujoco.MjModel, key: int, axis: Axis, settings: PlantSettings) -> BendModel | None:
    """Linearise a rig that bends at its keyframe.

    Args:
        model: The compiled model.
        key: The keyframe at which it stands upright.
        axis: Its axis.
        settings: The plant's settings.

    Returns:
        The rig; None if its frame is rigid.
    """
    if not settings.bends:
        return None
    nv = model.nv
    command = np.zeros(model.nu)
    for module in axis.modules:
        command[module.servo] = module.direction
    A, B = state_matrix(model, key), input_column(model, key, command)[:, None]
    bend = int(model.joint(BEND_JOINT).dofadr[0])
    tilt = np.zeros(nv)
    tilt[axis.line.dof] = axis.line.rate(np.ones(nv))
    shown = tilt.copy()
    shown[bend] = 0.0 if settings.bend_beyond == "both" else 1.0
    gimbals = np.zeros(nv)
    for module in axis.modules:
        gimbals[module.gimbal_dof] = module.direction / len(axis.modules)

    def rig(A: np.ndarray, B: np.ndarray) -> LinearRig:
        at, rate = np.eye(len(A))[:nv], np.eye(len(A))[nv : 2 * nv]
        rows = (shown @ at, shown @ A[nv : 2 * nv], gimbals @ at, tilt @ rate, shown @ rate)
        return LinearRig(A, B, np.array(rows))

    return BendModel(
        settings.bend_frequency_hz,
        settings.bend_damping_ratio,
        rig(A, B),
        rig(*(_held(model, key, bend, matrix) for matrix in (A, B))),
    )


def _held(model: mujoco.MjModel, key: int, bend: int, matrix: np.ndarray) -> np.ndarray:
    """The rows of a state or input matrix while the bend is held: its torque takes its acceleration away."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    unit, gives = np.zeros((1, model.nv)), np.zeros((1, model.nv))
    unit[0, bend] = 1.0
    mujoco.mj_solveM(model, data, gives, unit)
    nv, held = model.nv, matrix.copy()
    held[nv : 2 * nv] -= np.outer(gives[0] / gives[0, bend], matrix[nv + bend])
    held[bend] = held[nv + bend] = 0.0
    if held.shape[1] == len(held):
        held[:, [bend, nv + bend]] = 0.0
    return held
