"""The keyframe that a rig starts from, and the robot's own, which get more joints than they had."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from cmg_mj.plant.mounting.robot import joint_sizes
from cmg_mj.plant.mounting.servos import at_rest
from cmg_mj.plant.parts import EQUILIBRIUM_KEY

Poses = Mapping[str, np.ndarray]
"""Where each joint stands, by its name."""


def poses_of(model: mujoco.MjModel, qpos: np.ndarray) -> dict[str, np.ndarray]:
    """Where each joint of a compiled model stands, by its name."""
    found = {}
    for i in range(model.njnt):
        address = int(model.jnt_qposadr[i])
        found[model.joint(i).name] = qpos[address : address + joint_sizes(int(model.jnt_type[i]))[0]].copy()
    return found


def as_qpos(model: mujoco.MjModel, poses: Poses) -> np.ndarray:
    """The same as a vector; joints that are left out stand where the model's reference has them."""
    qpos = model.qpos0.copy()
    for name, values in poses.items():
        address = int(model.joint(name).qposadr[0])
        qpos[address : address + len(values)] = values
    return qpos


def write_keyframe(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    name: str,
    qpos: np.ndarray,
    speeds: Mapping[str, float],
    ctrl: Mapping[str, float],
) -> None:
    """Write a keyframe in which the robot stands and its flywheels turn.

    Args:
        spec: The model, which gets the keyframe.
        model: The same, compiled.
        name: The keyframe's.
        qpos: Where the joints stand, (nq,).
        speeds: Of the joints that turn, by name [rad/s].
        ctrl: Of the actuators that are driven, by name. Position servos hold where their joints stand.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    qvel, (act, controls) = np.zeros(model.nv), at_rest(model, data)
    for joint, speed in speeds.items():
        qvel[int(model.joint(joint).dofadr[0])] = speed
    for i in range(model.nu):
        controls[i] = ctrl.get(model.actuator(i).name, controls[i])
    spec.add_key(name=name, qpos=qpos, qvel=qvel, act=act, ctrl=controls)


def pop_keyframes(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[tuple[str, dict[str, np.ndarray]]]:
    """Take a robot's own keyframes out, before it gets more joints: their names, and where the joints stand."""
    kept = [(model.key(i).name, poses_of(model, model.key_qpos[i])) for i in range(model.nkey)]
    kept = [
        (name, poses) for name, poses in kept if name != EQUILIBRIUM_KEY
    ]  # of an axis mounted earlier: written anew
    for key in list(spec.keys):
        spec.delete(key)
    return kept
