"""MuJoCo's side of every comparison: the compiled rig at given states, and its motion from them."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch

from cmg_mj.plant.plant import Plant


class Motion(NamedTuple):
    """n_worlds motions, the initial state first."""

    qpos: np.ndarray
    """(n_worlds, n_steps + 1, n_joints) [rad]."""
    qvel: np.ndarray
    """(n_worlds, n_steps + 1, n_joints) [rad/s]."""
    act: np.ndarray
    """The servos' setpoints, (n_worlds, n_steps + 1, n_modules) [rad]."""


def passive(plant: Plant, *, gravity: bool = True) -> mujoco.MjModel:
    """A copy of the plant's model in which servos and motors exert no torque."""
    model = copy(plant.model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    if not gravity:
        model.opt.gravity[:] = 0.0
    return model


def states(
    model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray | float = 0.0, torques: np.ndarray | float = 0.0
) -> Iterator[mujoco.MjData]:
    """All that MuJoCo computes at each row of qpos under torques at the joints. One MjData serves all."""
    data = mujoco.MjData(model)
    for q, v, tau in zip(*np.broadcast_arrays(qpos, qvel, torques), strict=True):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, tau
        mujoco.mj_forward(model, data)
        yield data


def mass_matrices(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """The compiled rig's mass matrix at each row of qpos, (n_states, n_joints, n_joints) [kg m^2]."""
    dense = np.zeros((len(qpos), model.nv, model.nv))
    for matrix, data in zip(dense, states(model, qpos), strict=True):
        mujoco.mj_fullM(model, data, matrix)
    return dense


def motion(
    model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray, n_steps: int, control: np.ndarray | None = None
) -> Motion:
    """Run one world from each row, servo setpoints starting where the gimbals are.

    Args:
        model: The rig.
        qpos: Initial angles, (n_worlds, n_joints) [rad].
        qvel: Initial rates, (n_worlds, n_joints) [rad/s].
        n_steps: Physics steps to run.
        control: Controls held over each step, (n_worlds, n_steps, n_actuators); none for a passive rig.
    """
    servos = [i for i in range(model.nu) if model.actuator_actnum[i]]
    act = qpos[:, model.jnt_qposadr[model.actuator_trnid[servos, 0]]]
    batch = Batch(model, nsim=len(qpos), nthread=1)
    batch.qpos, batch.qvel, batch.act = qpos, qvel, act
    run = batch.rollout(n_steps, control, record=("qpos", "qvel", "act"))
    start = {"qpos": qpos, "qvel": qvel, "act": act}
    return Motion(*(np.concatenate([start[name][:, None], run[name]], axis=1) for name in Motion._fields))
