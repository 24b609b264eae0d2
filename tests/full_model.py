"""MuJoCo's side of every comparison: the compiled rig at a given state, and its motion from many states at once."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch

from cmg_mj.plant import Plant


class Motion(NamedTuple):
    """n_worlds motions, the initial state first."""

    qpos: np.ndarray
    """(n_worlds, n_steps + 1, n_joints) [rad]."""
    qvel: np.ndarray
    """(n_worlds, n_steps + 1, n_joints) [rad/s]."""
    act: np.ndarray
    """The servos' setpoints, (n_worlds, n_steps + 1, n_cubes) [rad]."""


def passive(plant: Plant, *, gravity: bool = True) -> mujoco.MjModel:
    """A copy of the plant's model in which servos and motors exert no torque."""
    model = copy(plant.model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    if not gravity:
        model.opt.gravity[:] = 0.0
    return model


def at(
    model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray | float = 0.0, applied: np.ndarray | float = 0.0
) -> mujoco.MjData:
    """Everything MuJoCo computes at one state, under torques applied at the joints."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    data.qvel[:] = qvel
    data.qfrc_applied[:] = applied
    mujoco.mj_forward(model, data)
    return data


def mass_matrix(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """The compiled rig's mass matrix, (n_joints, n_joints) [kg m^2]."""
    dense = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, at(model, qpos), dense)
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
