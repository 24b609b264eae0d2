"""The keyframe that a run starts from, and the robot's own keyframes, extended by the new joints."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from cmg_mj.features.mounting.servos import rest_controls
from cmg_mj.plant.elements import EQUILIBRIUM_KEY, joint_sizes
from cmg_mj.plant.mjcf import posed

Poses = Mapping[str, np.ndarray]
"""Joint -> its position in qpos."""


def poses_of(model: mujoco.MjModel, qpos: np.ndarray) -> dict[str, np.ndarray]:
    """Return the position of each joint of a compiled model, by its name."""
    poses = {}
    for i in range(model.njnt):
        address = int(model.jnt_qposadr[i])
        poses[model.joint(i).name] = qpos[address : address + joint_sizes(int(model.jnt_type[i]))[0]].copy()
    return poses


def as_qpos(model: mujoco.MjModel, poses: Poses) -> np.ndarray:
    """Return poses as a vector qpos, with the model's reference for joints that have none."""
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
        name: Name of the keyframe.
        qpos: Joint positions, (nq,).
        speeds: Joint -> speed, for those that turn [rad/s].
        ctrl: Actuator -> control. Other position servos hold their joints in place.
    """
    qvel, (act, controls) = np.zeros(model.nv), rest_controls(model, posed(model, qpos))
    for joint, speed in speeds.items():
        qvel[int(model.joint(joint).dofadr[0])] = speed
    for i in range(model.nu):
        controls[i] = ctrl.get(model.actuator(i).name, controls[i])
    spec.add_key(name=name, qpos=qpos, qvel=qvel, act=act, ctrl=controls)


def pop_keyframes(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[tuple[str, dict[str, np.ndarray]]]:
    """Remove a robot's own keyframes before it gets more joints, and return their names and poses."""
    keyframes = [(model.key(i).name, poses_of(model, model.key_qpos[i])) for i in range(model.nkey)]
    # The equilibrium of an axis mounted earlier is written anew.
    keyframes = [(name, poses) for name, poses in keyframes if name != EQUILIBRIUM_KEY]
    for key in list(spec.keys):
        spec.delete(key)
    return keyframes
